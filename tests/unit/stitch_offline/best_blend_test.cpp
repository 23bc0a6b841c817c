// Raymaps at best quality against the scene itself, evaluated along each pixel's ray by the simulator.
#include "stitch/offline/best_blend.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "stitch/offline/offline_blend.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::offline {
namespace {

constexpr int kWidth = 256;

bool anywhere(const Eigen::Vector3d& /*direction*/) { return true; }

/// dB between a grey raymap and the scene, of the rays that count.
double psnr(const DecodedImage& raymap, const std::string& layout_name, const hal::sim::ScenePtr& scene,
            bool (*counts)(const Eigen::Vector3d&) = anywhere) {
  const auto layout = geometry::make_layout(layout_name, raymap.width, raymap.height).value();
  double square = 0, count = 0;
  for (int y = 0; y < raymap.height; ++y) {
    for (int x = 0; x < raymap.width; ++x) {
      const Eigen::Vector3d d = layout->ray(x + 0.5, y + 0.5)->direction();
      if (!counts(d)) continue;
      const hal::sim::Light light = scene->light({d.x(), d.y(), d.z()}, 0.02);
      const double grey = 255 * std::clamp(0.299 * light.r + 0.587 * light.g + 0.114 * light.b, 0.0, 1.0);
      square += std::pow(raymap.bytes[static_cast<std::size_t>(y * raymap.width + x)] - grey, 2);
      ++count;
    }
  }
  return 10 * std::log10(255 * 255 / (square / count));
}

DecodedImage best(const test::RenderedRig& rig, const table::RaymapSpec& spec, int threads = 2) {
  auto blend = BestBlend::make(rig.truth, spec, threads);
  EXPECT_TRUE(blend) << blend.error().text();
  auto raymap = blend->blend(rig.frames());
  EXPECT_TRUE(raymap) << raymap.error().text();
  return std::move(*raymap);
}

const table::RaymapSpec kSphere{"equirectangular", kWidth, kWidth / 2, PixelFormat::kGrey8};

TEST(BestBlend, HeadsAtOnePoint_AreAsCloseToTheSceneAsTheBoardsBlend) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(160), town);
  const auto board = OfflineBlend::make(rig.truth, kSphere, {}, rig.format, 2, {})->blend(rig.frames()).value();
  EXPECT_GT(psnr(best(rig, kSphere), "equirectangular", town), psnr(board, "equirectangular", town) - 0.1);
}

/// Within about 3 degrees of a seam between two of six_fisheyes(), far from the corner of three.
bool near_a_seam(const Eigen::Vector3d& direction) {
  Eigen::Vector3d a = direction.cwiseAbs();
  std::sort(a.begin(), a.end());
  return a[2] - a[1] < 0.08 && a[0] < 0.4;
}

TEST(BestBlend, HeadsApart_ShowTheSceneAsSeenFromBetweenThem) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const test::Room ball{test::Room::Shape::kBall, 2};
  const Calibration one_point = test::six_fisheyes(160);
  const auto seen_best = [&](const Calibration& rig) {
    return psnr(best(test::render_rig_in(ball, rig, town), kSphere), "equirectangular", town, near_a_seam);
  };
  const test::RenderedRig apart = test::render_rig_in(ball, test::spread_out(one_point, 0.1), town);
  const auto board = OfflineBlend::make(apart.truth, kSphere, {}, apart.format, 2, {})->blend(apart.frames()).value();
  const double moved = psnr(best(apart, kSphere), "equirectangular", town, near_a_seam);
  EXPECT_GT(moved, psnr(board, "equirectangular", town, near_a_seam) + 4) << "which blends heads where they are";
  EXPECT_GT(moved, seen_best(one_point) - 3);
}

/// The mean over the rays that count of the variance of a pixel's levels from frame to frame.
double flicker(const std::vector<DecodedImage>& film, bool (*counts)(const Eigen::Vector3d&)) {
  const auto layout = geometry::make_layout("equirectangular", kWidth, kWidth / 2).value();
  double sum = 0, count = 0;
  for (int y = 0; y < kWidth / 2; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (!counts(layout->ray(x + 0.5, y + 0.5)->direction())) continue;
      double mean = 0, square = 0;
      for (const DecodedImage& frame : film) {
        const double level = frame.bytes[static_cast<std::size_t>(y * kWidth + x)];
        mean += level / static_cast<double>(film.size());
        square += level * level / static_cast<double>(film.size());
      }
      sum += square - mean * mean;
      ++count;
    }
  }
  return sum / count;
}

/// Where one head alone sees the scene.
bool in_the_middle(const Eigen::Vector3d& direction) { return direction.cwiseAbs().maxCoeff() > 0.97; }

TEST(BestBlend, AFilmOfHeadsApart_FlickersNearSeamsAsTheHeadsNoiseDoes) {
  const test::RenderedRig rig = test::render_rig_in(
      {test::Room::Shape::kBall, 2}, test::spread_out(test::six_fisheyes(160), 0.1), hal::sim::town_square_scene(3));
  auto blend = BestBlend::make(rig.truth, kSphere, 2);
  ASSERT_TRUE(blend);
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 2);
  std::vector<DecodedImage> film;
  for (int frame = 0; frame < 6; ++frame) {
    test::RenderedRig noisy = rig;
    for (auto& bytes : noisy.bytes)
      for (std::uint8_t& level : bytes)
        level = static_cast<std::uint8_t>(std::clamp(std::lround(level + noise(random)), 0L, 255L));
    film.push_back(blend->blend(noisy.frames()).value());
  }
  EXPECT_LT(flicker(film, near_a_seam), 1.21 * flicker(film, in_the_middle));
}

/// The smallest part of a raymap beyond which it is black; its columns may go on at 0.
bands::Window shown_part(const DecodedImage& raymap) {
  const auto shows = [&](int x, int y) { return raymap.bytes[static_cast<std::size_t>(y * raymap.width + x)] != 0; };
  std::vector<bool> columns(static_cast<std::size_t>(raymap.width)), rows(static_cast<std::size_t>(raymap.height));
  for (int y = 0; y < raymap.height; ++y) {
    for (int x = 0; x < raymap.width; ++x) {
      if (shows(x, y)) columns[static_cast<std::size_t>(x)] = rows[static_cast<std::size_t>(y)] = true;
    }
  }
  bands::Window part;
  part.y = static_cast<int>(std::ranges::find(rows, true) - rows.begin());
  part.height = raymap.height - part.y - static_cast<int>(std::find(rows.rbegin(), rows.rend(), true) - rows.rbegin());
  int gap = 0, longest = 0;
  for (int x = 0; x < 2 * raymap.width; ++x) {
    gap = columns[static_cast<std::size_t>(x % raymap.width)] ? 0 : gap + 1;
    if (gap <= longest) continue;
    longest = gap;
    part.x = (x + 1) % raymap.width;
  }
  part.width = raymap.width - longest;
  return part;
}

TEST(BestBlend, ThePartThatHeadsSee_IsThatOfTheWholeSphere) {
  for (const double yaw : {20.0, 180.0}) {  // 180: on both sides of the picture's edge
    Calibration two = test::six_fisheyes(160, 100);
    two.heads.resize(2);
    const double c = std::cos(yaw * std::numbers::pi / 180), s = std::sin(yaw * std::numbers::pi / 180);
    for (HeadCalibration& head : two.heads) {
      const auto R = head.R_head_rig;
      for (std::size_t row = 0; row < 3; ++row) {
        head.R_head_rig[3 * row] = c * R[3 * row] + s * R[3 * row + 2];
        head.R_head_rig[3 * row + 2] = -s * R[3 * row] + c * R[3 * row + 2];
      }
    }
    const test::RenderedRig rig = test::render_rig(two, hal::sim::town_square_scene(3));
    const DecodedImage whole = best(rig, kSphere);
    const bands::Window part = shown_part(whole);
    ASSERT_LT(part.width, 0.7 * kWidth);
    EXPECT_EQ(part.x + part.width > kWidth, yaw == 180);
    const DecodedImage made = BestBlend::make(rig.truth, kSphere, 2, part)->blend(rig.frames()).value();
    ASSERT_EQ(made.width, part.width);
    ASSERT_EQ(made.height, part.height);
    int most = 0;
    for (int y = 0; y < part.height; ++y) {
      for (int x = 0; x < part.width; ++x) {
        const std::size_t at = static_cast<std::size_t>((part.y + y) * kWidth + (part.x + x) % kWidth);
        most = std::max(most, std::abs(made.bytes[static_cast<std::size_t>(y * part.width + x)] - whole.bytes[at]));
      }
    }
    EXPECT_LE(most, 1) << "levels; yaw " << yaw;
  }
}

TEST(BestBlend, NarrowPicturesFromTwoPlaces_AreBroughtTogetherInAPartOfTheSphere) {
  Calibration two;
  for (const double yaw : {-6.0, 6.0}) {
    two.heads.push_back(test::plain_head(yaw < 0 ? "left" : "right", 320, 240, yaw, 24));
    two.heads.back().position = {yaw / 300, 0, 0};  // 4 cm apart, which is 1.1 degrees at 2 m
  }
  const test::RenderedRig rig = test::render_rig_in({test::Room::Shape::kBall, 2}, two, hal::sim::town_square_scene(3));
  for (HeadCalibration& head : two.heads) head.position = {};  // which nobody knows
  constexpr int kCircle = 4096;
  const bands::Window part{kCircle / 2 - 220, kCircle / 4 - 120, 440, 240};
  const table::RaymapSpec sphere{"equirectangular", kCircle, kCircle / 2, PixelFormat::kGrey8};
  const auto checked = check_seams(two, rig.frames(), {kCircle, kCircle / 2}, 2);
  ASSERT_TRUE(checked) << checked.error().text();
  const std::vector<SeamCheck> board = *checked;
  std::vector<SeamCheck> best;
  ASSERT_TRUE(BestBlend::make(two, sphere, 2, part)->blend(rig.frames(), &best));
  ASSERT_EQ(board.size(), 1U);
  ASSERT_EQ(best.size(), 1U);
  EXPECT_NEAR(usual_jump(board[0]), 1.1 / 360 * kCircle, 4) << "px, by geometry";
  EXPECT_LE(usual_jump(best[0]), kFinePx);
}

TEST(BestBlend, ACube_ShowsTheScene) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(160), town);
  const geometry::RaymapSize size = geometry::LayoutName::parse("cube").value().size_for_width(192);
  const table::RaymapSpec cube{"cube", size.width, size.height, PixelFormat::kGrey8};
  const auto board = OfflineBlend::make(rig.truth, cube, {}, rig.format, 2, {})->blend(rig.frames()).value();
  EXPECT_GT(psnr(best(rig, cube), "cube", town), psnr(board, "cube", town) - 0.5);
}

TEST(BestBlend, AMissingHead_IsFilledByTheOthers) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(160, 190), town);
  auto blend = BestBlend::make(rig.truth, kSphere, 2);
  ASSERT_TRUE(blend);
  std::vector<ImageView> frames = rig.frames();
  frames[2].planes[0].data = nullptr;
  const auto raymap = blend->blend(frames);
  ASSERT_TRUE(raymap) << raymap.error().text();
  for (const std::uint8_t label : blend->labels()) ASSERT_NE(label, 2);
  EXPECT_GT(psnr(*raymap, "equirectangular", town), 20);
}

/// Half way between the axes of heads 0 and 1, and at the edge of head 0's picture.
class NearObject : public testing::TestWithParam<double> {};

TEST_P(NearObject, SeenByOneHeadAlone_IsShownWholeOrNotAtAll) {
  constexpr double kRadius = 8 * std::numbers::pi / 180;
  const double yaw = GetParam() * std::numbers::pi / 180;
  const Eigen::Vector3d middle(std::sin(yaw), 0, std::cos(yaw));
  const auto covers = [&](const geometry::Ray& ray) { return std::acos(ray.direction().dot(middle)) < kRadius; };
  test::RenderedRig rig = test::render_rig(test::six_fisheyes(160), hal::sim::town_square_scene(3));
  const DecodedImage without = best(rig, kSphere);
  const std::vector<geometry::Head> heads = geometry::make_heads(rig.truth).value();
  for (int i = 0; i < 160 * 160; ++i) {
    const auto ray = heads[1].unproject({i % 160 + 0.5, i / 160 + 0.5});
    std::uint8_t& sample = rig.bytes[1][static_cast<std::size_t>(i)];
    if (ray && covers(*ray)) sample = sample < 128 ? 255 : 0;
  }
  const DecodedImage with = best(rig, kSphere);
  const auto layout = geometry::make_layout("equirectangular", kWidth, kWidth / 2).value();
  double all = 0, shown = 0;
  for (int y = 0; y < kWidth / 2; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (!covers(*layout->ray(x + 0.5, y + 0.5))) continue;
      const auto at = static_cast<std::size_t>(y * kWidth + x);
      all += 1;
      shown += std::abs(with.bytes[at] - without.bytes[at]) > 60 ? 1 : 0;
    }
  }
  ASSERT_GT(all, 50);
  // Beside it, and where it is not shown, the background may be moved: the flow of an object that one head alone sees
  // is unknown.
  EXPECT_GT(std::abs(shown / all - 0.5), 0.375) << "shown: " << shown << " of " << all << " pixels";
}

INSTANTIATE_TEST_SUITE_P(Yaw, NearObject, testing::Values(45.0, 63.0));

TEST(BestBlend, ThreadsDoNotMatter) {
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(96), hal::sim::town_square_scene(3));
  EXPECT_TRUE(best(rig, kSphere, 1).bytes == best(rig, kSphere, 3).bytes);
}

TEST(BestBlend, BadInput_IsNamed) {
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(96), hal::sim::town_square_scene(3));
  auto blend = BestBlend::make(rig.truth, kSphere, 2);
  ASSERT_TRUE(blend);
  std::vector<ImageView> frames = rig.frames();
  frames[3].width -= 2;
  const auto wrong = blend->blend(frames);
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, Errc::kHeadMismatch);
  EXPECT_NE(wrong.error().message.find("head 3"), std::string::npos) << wrong.error().message;
  frames.pop_back();
  EXPECT_FALSE(blend->blend(frames));
  table::RaymapSpec spec = kSphere;
  spec.format = PixelFormat::kI420;
  EXPECT_EQ(BestBlend::make(rig.truth, spec, 2).error().code, Errc::kUnsupported);
  spec = {"equirectangular", 16384, 8192, PixelFormat::kGrey8};
  EXPECT_EQ(BestBlend::make(rig.truth, spec, 2).error().code, Errc::kTooLarge);
}

}  // namespace
}  // namespace nodal::offline
