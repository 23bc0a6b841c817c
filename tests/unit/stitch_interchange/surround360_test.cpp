// Facebook's rigs, with its camera's formulas written here.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <nlohmann/json.hpp>

#include "files.h"
#include "stitch/geometry/head.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using nlohmann::json;

Vector3d vector(const json& v) { return Vector3d(v[0].get<double>(), v[1].get<double>(), v[2].get<double>()); }

/// pixel(p) of their Camera: rotate into right, up, backward; project by type; distort; scale by focal; shift.
Vector2d their_pixel(const json& camera, const Vector3d& world) {
  const Vector3d p(vector(camera["right"]).dot(world), vector(camera["up"]).dot(world),
                   -vector(camera["forward"]).dot(world));
  const double xy = p.head<2>().norm();
  double r = 0;
  if (camera["type"] == "FTHETA") r = std::atan2(xy, -p.z());
  if (camera["type"] == "RECTILINEAR") r = xy / -p.z();
  if (camera["type"] == "EQUISOLID") r = 2 * std::sqrt((1 + p.z() / p.norm()) / 2);
  double bent = r, power = r;
  for (const json& d : camera["distortion"]) {
    power *= r * r;
    bent += d.get<double>() * power;
  }
  return {camera["focal"][0].get<double>() * bent * p.x() / xy + camera["principal"][0].get<double>(),
          camera["focal"][1].get<double>() * bent * p.y() / xy + camera["principal"][1].get<double>()};
}

/// The largest distance between their pixels and ours, where our heads see; world axes are converted.
/// `unit`: m of one of the file's; with a distance, what is seen lies there.
double worst(const json& rig, const Calibration& calibration, double unit = 0) {
  const auto heads = *geometry::make_heads(calibration);
  double most = 0;
  int seen = 0;
  for (std::size_t i = 0; i < heads.size(); ++i) {
    for (int n = 0; n < 4000; ++n) {
      const double z = 1 - 2 * (n + 0.5) / 4000, a = 2.399963 * n, s = std::sqrt(1 - z * z);
      const Vector3d world(s * std::cos(a), s * std::sin(a), z);
      const auto ours = heads[i].project(geometry::Ray::towards(-world.y(), -world.z(), world.x()));
      if (!ours || !heads[i].contains(*ours)) continue;
      const json& camera = rig["cameras"][i];
      const bool near = calibration.distance > 0;
      const Vector2d theirs =
          their_pixel(camera, near ? Vector3d(calibration.distance * world - unit * vector(camera["origin"])) : world);
      most = std::max(most, (theirs - Vector2d(ours->x, ours->y)).norm());
      ++seen;
    }
  }
  EXPECT_GT(seen, 500);
  return most;
}

TEST(ImportSurround360, RigOfSixteenFisheyes_SeesWhatItsOwnCodeSees) {
  NODAL_SHARED_FILE_OR_SKIP(text, "calibrations/fb360dep_rig.json");
  const auto import = import_project(text, "fb360");
  ASSERT_TRUE(import) << import.error().text();
  EXPECT_EQ(import->calibration.heads.size(), 16u);
  // Their axes are rounded: to a hundredth of an arc second.
  EXPECT_LT(worst(json::parse(text), import->calibration), 1e-4);
  EXPECT_NE(import->notes.at(0).find("nodal point"), std::string::npos);
  EXPECT_NE(import->notes.at(0).find("metres"), std::string::npos);
  Calibration near = import->calibration;
  near.distance = 1.5;
  EXPECT_LT(worst(json::parse(text), near, 1), 1e-4);
}

TEST(ImportSurround360, RigOfSeventeenCameras_IsImportedAndOneOfMoreThanTheLimitIsRefused) {
  NODAL_SHARED_FILE_OR_SKIP(text, "calibrations/surround360_camera_rig.json");
  json rig = json::parse(text);
  const auto import = import_project(text, "surround");
  ASSERT_TRUE(import) << import.error().text();
  ASSERT_EQ(import->calibration.heads.size(), 17U);
  EXPECT_LT(worst(rig, import->calibration), 1e-4);
  Calibration near = import->calibration;
  near.distance = 0.8;
  EXPECT_LT(worst(rig, near, 0.01), 1e-4) << "this file is in centimetres";
  for (int i = 0; rig["cameras"].size() < 65; ++i) {
    json more = rig["cameras"][0];
    more["id"] = "more" + std::to_string(i);
    rig["cameras"].push_back(more);
  }
  const auto refused = import_project(rig.dump(), "surround");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("65 cameras"), std::string::npos) << refused.error().message;
}

TEST(ImportSurround360, EquisolidLens_IsFittedAndTold) {
  const json rig{{"cameras",
                  {{{"id", "a"},
                    {"type", "EQUISOLID"},
                    {"right", {0, -1, 0}},
                    {"up", {0, 0, 1}},
                    {"forward", {1, 0, 0}},
                    {"resolution", {1000, 1000}},
                    {"principal", {500, 510}},
                    {"focal", {340, -340}},
                    {"distortion", {0.01, 0}}}}}};
  const auto import = import_project(rig.dump(), "one");
  ASSERT_TRUE(import) << import.error().text();
  EXPECT_LT(worst(rig, import->calibration), 0.1);
  EXPECT_NE(import->notes.at(0).find("EQUISOLID"), std::string::npos);
}

TEST(ImportSurround360, BrokenCameras_AreRefusedByName) {
  const json good{{"id", "cam7"},         {"type", "FTHETA"},       {"right", {0, -1, 0}}, {"up", {0, 0, 1}},
                  {"forward", {1, 0, 0}}, {"resolution", {10, 10}}, {"focal", {5.0, -5.0}}};
  const auto refusal = [&](const char* key, const json& value) {
    json camera = good;
    camera[key] = value;
    const auto result = import_project(json{{"cameras", {camera}}}.dump(), "one");
    return result ? std::string("accepted") : result.error().message;
  };
  EXPECT_NE(refusal("type", "CONVEX").find("camera 'cam7': there is no lens type 'CONVEX'"), std::string::npos);
  EXPECT_NE(refusal("focal", {5, 5}).find("'focal'"), std::string::npos);
  EXPECT_NE(refusal("up", {0, 0, -1}).find("reflection"), std::string::npos);
  EXPECT_NE(refusal("resolution", {1e9, 10}).find("'resolution'"), std::string::npos);
  EXPECT_NE(refusal("distortion", {"x"}).find("'distortion'"), std::string::npos);
  EXPECT_EQ(refusal("id", "cam8"), "accepted");
}

}  // namespace
}  // namespace nodal::interchange
