// Projects of real rigs written by other programs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>

#include "files.h"
#include "protocol/base/angles.h"
#include "stitch/geometry/head.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

/// Angles between the two rays of each control point, degrees, sorted.
std::vector<double> residuals(const Calibration& calibration, const std::vector<ControlPoint>& points) {
  const Result<std::vector<geometry::Head>> heads = geometry::make_heads(calibration);
  EXPECT_TRUE(heads) << (heads ? "" : heads.error().text());
  std::vector<double> angles;
  for (const ControlPoint& point : points) {
    const auto a = (*heads)[point.head_a].unproject(point.pixel_a);
    const auto b = (*heads)[point.head_b].unproject(point.pixel_b);
    EXPECT_TRUE(a && b);
    if (a && b) angles.push_back(geometry::angle_between(*a, *b) / kRadiansPerDegree);
  }
  std::ranges::sort(angles);
  return angles;
}

bool has_note(const ImportResult& import, const std::string& words) {
  return std::ranges::any_of(import.notes,
                             [&](const std::string& note) { return note.find(words) != std::string::npos; });
}

void report(const std::vector<double>& angles) {
  testing::Test::RecordProperty("median_deg", std::to_string(angles[angles.size() / 2]));
  testing::Test::RecordProperty("p90_deg", std::to_string(angles[angles.size() * 9 / 10]));
  testing::Test::RecordProperty("max_deg", std::to_string(angles.back()));
  std::printf("%zu control points: median %.3f, 90 %% within %.3f, worst %.3f degrees\n", angles.size(),
              angles[angles.size() / 2], angles[angles.size() * 9 / 10], angles.back());
}

TEST(RealProjects, RooftopRigOfThreeFisheyes_ItsMatchedPointsAgreeBetweenHeads) {
  NODAL_SHARED_FILE_OR_SKIP(pts, "stitchem_3cam/3_Cam_-_Sample.pts");
  NODAL_SHARED_FILE_OR_SKIP(ptv, "stitchem_3cam/3_Cam_Sample_-_Project.ptv");
  const Result<ImportResult> import = import_project(pts, "rooftop");
  ASSERT_TRUE(import) << import.error().text();
  ASSERT_EQ(import->calibration.heads.size(), 3u);
  EXPECT_EQ(import->calibration.heads[0].name, "input-00");
  EXPECT_EQ(import->calibration.heads[0].width, 3840);
  EXPECT_TRUE(has_note(*import, "vignetting"));
  EXPECT_TRUE(has_note(*import, "masks"));
  // Another program's feature matches for the same rig; its frame pixels equal picture pixels.
  const nlohmann::json project = nlohmann::json::parse(ptv);
  std::vector<ControlPoint> points;
  for (const auto& p : project["pano"]["calibration_control_points"]["matched_control_points"]) {
    points.push_back({p["input_index0"].get<std::size_t>(),
                      {p["x0"].get<double>() + 0.5, p["y0"].get<double>() + 0.5},
                      p["input_index1"].get<std::size_t>(),
                      {p["x1"].get<double>() + 0.5, p["y1"].get<double>() + 0.5}});
  }
  ASSERT_EQ(points.size(), 137u);
  const std::vector<double> angles = residuals(import->calibration, points);
  report(angles);
  // Much of the distance is parallax on the roof, and the fit of the project: the other program's own calibration
  // leaves 1.57 degrees on its own points. A wrong sign would give tens of degrees.
  EXPECT_LE(angles[angles.size() / 2], 1.4);
  EXPECT_LE(angles.back(), 7);
}

TEST(RealProjects, PtguiRingOfFiveFisheyes_ControlPointDistancesAreThoseThatPtguiWrote) {
  NODAL_SHARED_FILE_OR_SKIP(pts, "calibrations/ptgui_input_panorama.pts");
  const Result<ImportResult> import = import_project(pts, "ring");
  ASSERT_TRUE(import) << import.error().text();
  ASSERT_EQ(import->calibration.heads.size(), 5u);
  const Result<std::vector<geometry::Head>> heads = geometry::make_heads(import->calibration);
  ASSERT_TRUE(heads) << heads.error().text();
  // PTGui notes beside each point the distance, in px of the second picture, of the first one's ray from it. This
  // depends on every number of both lenses and poses, and on the pixel centre convention.
  const std::regex noted("\nc [^\n]* t0\\s*\n# Control Point No \\d+: ([0-9.eE+-]+)");
  std::vector<double> distances;
  for (std::sregex_iterator at(pts.begin(), pts.end(), noted), end; at != end; ++at)
    distances.push_back(std::stod((*at)[1]));
  ASSERT_EQ(distances.size(), import->control_points.size());
  ASSERT_EQ(distances.size(), 261u);
  double worst = 0;
  for (std::size_t k = 0; k < distances.size(); ++k) {
    const ControlPoint& point = import->control_points[k];
    const auto ray = (*heads)[point.head_a].unproject(point.pixel_a);
    ASSERT_TRUE(ray);
    const auto projected = (*heads)[point.head_b].project(*ray);
    ASSERT_TRUE(projected);
    const double distance = std::hypot(projected->x - point.pixel_b.x, projected->y - point.pixel_b.y);
    worst = std::max(worst, std::abs(distance - distances[k]));
  }
  std::printf("261 distances of up to 16 px: ours and PTGui's differ by at most %.6f px\n", worst);
  EXPECT_LE(worst, 0.005);
}

TEST(RealProjects, KodakPairOfFisheyes_Imports) {
  NODAL_SHARED_FILE_OR_SKIP(pto, "calibrations/kodak_dualfisheye.pto");
  const Result<ImportResult> import = import_project(pto, "kodak");
  ASSERT_TRUE(import) << import.error().text();
  ASSERT_EQ(import->calibration.heads.size(), 2u);
  EXPECT_EQ(import->calibration.heads[1].name, "102_S0JA0010000056L0");
  // The project's k lines; Hugin's pixel centres are at whole numbers, Nodal's half a pixel further.
  const auto& masks = import->calibration.heads[0].region.masks;
  ASSERT_EQ(masks.size(), 1u);
  EXPECT_EQ(masks[0][0], (Region::Point{1240.5, 103.5}));
  EXPECT_EQ(masks[0][1], (Region::Point{692.5, 329.5}));
  EXPECT_EQ(import->calibration.heads[1].region.masks.at(0).at(0), (Region::Point{996.5, 144.5}));
  EXPECT_TRUE(has_note(*import, "circular fisheye without a crop"));
  EXPECT_TRUE(has_note(*import, "Ra..Re"));
  EXPECT_EQ(import->control_points.size(), 19u);
  // Exposure 4.93 and 5.06: the mean is between; a head exposed for more light (a larger Eev) received less.
  const auto& gain = import->calibration.heads[0].gain;
  EXPECT_NEAR(gain[1], std::exp2((5.0622693313378 - 4.93288580414146) / 2), 1e-12);
  EXPECT_NEAR(import->calibration.heads[1].gain[2] * gain[1], 1.02579556508196, 1e-12);
}

}  // namespace
}  // namespace nodal::interchange
