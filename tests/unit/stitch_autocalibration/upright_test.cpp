// Up in drawn scenes: a bright sky above a horizon, with posts that stand upright, seen by turned heads.
#include "stitch/autocalibration/upright.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "protocol/base/angles.h"
#include "stitch/geometry/rotation.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::autocalibration {
namespace {

struct World {
  bool horizon = true, posts = true;
  enum class Ground { kPlain, kStripes, kTiles } ground = Ground::kPlain;
};

/// Black and white stripes or tiles of a metre on the ground, 1.5 m below, up to where the haze hides them: -1 or 1,
/// and 0 elsewhere.
double pattern(const Eigen::Vector3d& ray, World::Ground ground) {
  if (ground == World::Ground::kPlain || ray.y() < 0.03) return 0;
  const double x = 1.5 * ray.x() / ray.y(), z = 1.5 * ray.z() / ray.y();
  const double sign =
      std::sin(std::numbers::pi * x) * (ground == World::Ground::kTiles ? std::sin(std::numbers::pi * z) : 1);
  return (sign > 0 ? 1 : -1) * std::min(1.0, 8 / std::hypot(x, z));
}

/// The level in a direction of a world whose up is (0, -1, 0).
float level(const Eigen::Vector3d& ray, const World& world) {
  const double pitch = std::asin(-ray.y()), yaw = std::atan2(ray.x(), ray.z());
  double level = world.horizon ? (pitch > 0 ? 190 : 70) : 130 + 60 * std::sin(pitch);
  const double stripe = std::fmod(yaw / kRadiansPerDegree + 360, 24);
  if (world.posts && stripe < 5 && std::abs(pitch) < 0.6) level -= 45;
  return static_cast<float>(level + 50 * pattern(ray, world.ground));
}

struct Scene {
  std::vector<geometry::Head> heads;
  std::vector<Picture> pictures;
};

/// The world seen by a rig that is turned by R_world_rig.
Scene seen_by(const Calibration& rig, const Eigen::Matrix3d& R_world_rig, const World& world) {
  Scene scene{geometry::make_heads(rig).value(), {}};
  for (const geometry::Head& head : scene.heads) {
    Picture picture{head.width(), head.height(), {}};
    for (int y = 0; y < head.height(); ++y) {
      for (int x = 0; x < head.width(); ++x) {
        float sum = 0;
        for (int k = 0; k < 4; ++k) {
          const auto ray = head.unproject({x + 0.25 + 0.5 * (k % 2), y + 0.25 + 0.5 * (k / 2)});
          sum += ray ? level(R_world_rig * ray->direction(), world) : 0;
        }
        picture.values.push_back(sum / 4);
      }
    }
    scene.pictures.push_back(picture);
  }
  return scene;
}

double error_deg(const Upright& found, const Eigen::Matrix3d& R_world_rig) {
  const Eigen::Vector3d truth = R_world_rig.transpose() * Eigen::Vector3d(0, -1, 0);
  return std::acos(std::min(1.0, found.up.dot(truth))) / kRadiansPerDegree;
}

TEST(Upright, HorizonAndPosts_ToADegreeAtAnyTilt) {
  const Calibration rig = test::six_fisheyes(360, 120);
  for (const auto& [yaw, pitch, roll] :
       std::vector<std::array<double, 3>>{{0, 0, 0}, {20, 30, 0}, {0, 70, 40}, {100, -20, 170}}) {
    const Eigen::Matrix3d R = geometry::to_R_head_rig({yaw, pitch, roll});
    const Scene scene = seen_by(rig, R, {});
    const Upright found = find_upright(scene.heads, scene.pictures);
    EXPECT_LT(error_deg(found, R), 1) << yaw << " " << pitch << " " << roll;
    EXPECT_EQ(found.basis, UpBasis::kEdges);
  }
}

TEST(Upright, PostsAlone_OrTheHorizonAlone_AreEnough) {
  const Calibration rig = test::six_fisheyes(480, 120);
  const Eigen::Matrix3d R = geometry::to_R_head_rig({10, 25, -15});
  for (const World& world : {World{false, true}, World{true, false}}) {
    const Scene scene = seen_by(rig, R, world);
    EXPECT_LT(error_deg(find_upright(scene.heads, scene.pictures), R), 1.5) << world.horizon;
  }
}

TEST(Upright, UprightPicturesOfARing_StandUpright) {
  // Heads turned by 90 degrees about their axes, as phones held upright: the axis that they share is vertical.
  Calibration rig = test::ring(4, 320, 240);
  for (std::size_t h = 0; h < 4; ++h)
    rig.heads[h] = test::plain_head("cam" + std::to_string(h), 320, 240, 90.0 * static_cast<double>(h), 100);
  const Eigen::Matrix3d R = geometry::to_R_head_rig({0, 0, 90});
  Calibration turned = rig;
  for (HeadCalibration& head : turned.heads)
    head.R_head_rig = geometry::rows_of(geometry::matrix_of(head.R_head_rig) * R);
  const Scene scene = seen_by(turned, R, {});
  EXPECT_LT(error_deg(find_upright(scene.heads, scene.pictures), R), 1);
}

TEST(Upright, NothingToGoBy_IsNotSure) {
  const Calibration rig = test::six_fisheyes(64, 120);
  Scene scene = seen_by(rig, Eigen::Matrix3d::Identity(), {});
  for (Picture& picture : scene.pictures) std::ranges::fill(picture.values, 90.0F);
  const Upright found = find_upright(scene.heads, scene.pictures);
  EXPECT_NE(found.basis, UpBasis::kEdges);
  EXPECT_NEAR(found.up.norm(), 1, 1e-9);
  for (Picture& picture : scene.pictures) std::ranges::fill(picture.values, 0.0F);
  EXPECT_LT((find_upright(scene.heads, scene.pictures).up - Eigen::Vector3d(0, -1, 0)).norm(), 1e-9);
}

TEST(Upright, LinesOnTheGround_AreNoReasonToBeSure) {
  const Calibration rig = test::six_fisheyes(360, 120);
  for (const World::Ground ground : {World::Ground::kStripes, World::Ground::kTiles}) {
    for (const auto& [yaw, pitch, roll] :
         std::vector<std::array<double, 3>>{{15, 40, 100}, {70, -10, 60}, {40, 20, -85}, {200, -50, 30}}) {
      const Eigen::Matrix3d R = geometry::to_R_head_rig({yaw, pitch, roll});
      const Scene scene = seen_by(rig, R, {false, false, ground});
      const Upright found = find_upright(scene.heads, scene.pictures);
      EXPECT_TRUE(found.basis != UpBasis::kEdges || error_deg(found, R) < 3)
          << yaw << " " << pitch << " " << roll << ": off by " << error_deg(found, R) << " degrees";
    }
  }
}

TEST(Upright, PostsAndAHorizonAbovePatternedGround_AreAReasonToBeSure) {
  const Calibration rig = test::six_fisheyes(360, 120);
  for (const World::Ground ground : {World::Ground::kStripes, World::Ground::kTiles}) {
    const Eigen::Matrix3d R = geometry::to_R_head_rig({20, 30, 10});
    const Scene scene = seen_by(rig, R, {true, true, ground});
    const Upright found = find_upright(scene.heads, scene.pictures);
    EXPECT_LT(error_deg(found, R), 1);
    EXPECT_EQ(found.basis, UpBasis::kEdges);
  }
}

/// A room of 4 x 2.5 x 6 m with tiles of half a metre on all walls, by the light of a window in the right one: straight
/// edges in three directions, each of which could be up.
float room(const Eigen::Vector3d& ray) {
  const Eigen::Vector3d half(2, 1.25, 3);
  int wall = 0;
  for (int k = 1; k < 3; ++k)
    if (std::abs(ray[k]) * half[wall] > std::abs(ray[wall]) * half[k]) wall = k;
  const Eigen::Vector3d at = ray * (half[wall] / std::abs(ray[wall]));
  double sign = 1;
  for (int k = 0; k < 3; ++k)
    if (k != wall) sign *= std::sin(std::numbers::pi * (at[k] / 0.5 + 0.5));
  return static_cast<float>(110 + 50 * ray.x() + (sign > 0 ? 50 : -50));
}

/// Blobs without straight edges, brighter on the right: the light comes from the side.
float blobs(const Eigen::Vector3d& ray) {
  double level = 90 + 50 * ray.x();
  for (int k = 0; k < 60; ++k) {
    const double y = 1 - (2 * k + 1.0) / 60, turn = 2.399963 * k, r = std::sqrt(1 - y * y);
    const double c = ray.dot(Eigen::Vector3d(r * std::cos(turn), y, r * std::sin(turn)));
    level += (k % 2 == 0 ? 45 : -45) * std::exp((c - 1) / 0.002);
  }
  return static_cast<float>(level);
}

void show(Scene& scene, float (*world)(const Eigen::Vector3d&)) {
  for (std::size_t h = 0; h < scene.heads.size(); ++h) {
    for (int y = 0; y < scene.heads[h].height(); ++y) {
      for (int x = 0; x < scene.heads[h].width(); ++x) {
        const auto ray = scene.heads[h].unproject({x + 0.5, y + 0.5});
        scene.pictures[h].values[static_cast<std::size_t>(y * scene.heads[h].width() + x)] =
            ray ? world(ray->direction()) : 0;
      }
    }
  }
}

TEST(Upright, LightFromTheSideAndNoEdges_UpIsTheRingsAxisOrHowThePicturesAreHeld) {
  Calibration ring = test::ring(4, 240, 240), pair = test::six_fisheyes(240, 200);
  pair.heads = {pair.heads[0], pair.heads[2]};  // forward and back
  for (const auto& [rig, basis] : {std::pair(ring, UpBasis::kRing), std::pair(pair, UpBasis::kHeld)}) {
    Scene scene = seen_by(rig, Eigen::Matrix3d::Identity(), {});
    show(scene, blobs);
    const Upright found = find_upright(scene.heads, scene.pictures);
    EXPECT_LT(error_deg(found, Eigen::Matrix3d::Identity()), 0.1);
    EXPECT_EQ(found.basis, basis);
    // The same files from a camera that lay on its side, and says so.
    const std::vector<Eigen::Vector2d> left(rig.heads.size(), Eigen::Vector2d(-1, 0));
    if (basis == UpBasis::kHeld) {
      const Upright turned = find_upright({scene.heads[0]}, {scene.pictures[0]}, left);
      EXPECT_GT(turned.up.dot(-scene.heads[0].R_head_rig().row(0).transpose()), 0.99);
    }
  }
}

TEST(Upright, LightFromTheSideAndHeadsInEveryDirection_UpIsHowMostPicturesAreHeld) {
  const Calibration rig = test::six_fisheyes(240, 120);
  Scene scene = seen_by(rig, Eigen::Matrix3d::Identity(), {});
  show(scene, blobs);
  const Upright found = find_upright(scene.heads, scene.pictures);
  EXPECT_EQ(found.basis, UpBasis::kMajority);
  EXPECT_LT(error_deg(found, Eigen::Matrix3d::Identity()), 0.1) << "the light is 90 degrees from it";
}

TEST(Upright, InARoomWithLightFromTheSide_OfThreeDirectionsOfEdgesTheOneThatThePicturesAreHeldByIsUp) {
  Calibration pair = test::six_fisheyes(480, 200);
  pair.heads = {pair.heads[0], pair.heads[2]};  // forward and back
  Scene scene = seen_by(pair, Eigen::Matrix3d::Identity(), {});
  show(scene, room);
  const Upright found = find_upright(scene.heads, scene.pictures);
  EXPECT_LT(error_deg(found, Eigen::Matrix3d::Identity()), 1);
}

TEST(Upright, Rotation_TurnsUpUpAndForwardForward) {
  const Eigen::Vector3d up = Eigen::Vector3d(0.3, -0.8, 0.4).normalized();
  for (const Eigen::Vector3d& forward :
       {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 0, 0), up, Eigen::Vector3d(-up)}) {
    const Eigen::Matrix3d R = upright_rotation(up, forward);
    EXPECT_LT((R * up - Eigen::Vector3d(0, -1, 0)).norm(), 1e-12);
    EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(R.determinant(), 1, 1e-12);
    if (std::abs(forward.dot(up)) < 0.9) {
      EXPECT_NEAR((R * forward).x(), 0, 1e-12);
      EXPECT_GT((R * forward).z(), 0);
    }
  }
}

}  // namespace
}  // namespace nodal::autocalibration
