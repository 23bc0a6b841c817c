// VideoStitch's projects: real ones, and an invented one whose numbers are calculated by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "files.h"
#include "protocol/base/angles.h"
#include "stitch/calibration/difference.h"
#include "stitch/geometry/head.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

std::string project(const std::string& proj, const std::string& geometry, const std::string& extra = "") {
  return R"({"pano": {"inputs": [{"reader_config": "a.jpg", "width": 1000, "height": 800, "proj": ")" + proj + "\", " +
         extra + R"("geometries": [0, 0, {)" + geometry + "}]}]}}";
}

TEST(ImportVideoStitch, FisheyeWithMeterDistortion_FollowsItsFormula) {
  const auto import =
      import_project(project("ff_fisheye",
                             R"("horizontalFocal": 300, "verticalFocal": 310, "center_x": 7, "center_y": -4,
                 "distort_a": 0.01, "distort_b": -0.04, "distort_c": 0.02)",
                             R"("useMeterDistortion": true, )"),
                     "one");
  ASSERT_TRUE(import) << import.error().text();
  const auto head = *geometry::Head::make(import->calibration.heads[0]);
  for (const double a : {0.2, 0.7, 1.3}) {
    const double bent = a * (1 - 0.01 + 0.04 - 0.02 + 0.02 * a - 0.04 * a * a + 0.01 * a * a * a);
    const auto right = head.project(geometry::Ray::towards(std::sin(a), 0, std::cos(a)));
    const auto down = head.project(geometry::Ray::towards(0, std::sin(a), std::cos(a)));
    ASSERT_TRUE(right && down);
    EXPECT_NEAR(right->x, 507 + 300 * bent, 1e-6);
    EXPECT_NEAR(right->y, 396, 1e-6);
    EXPECT_NEAR(down->y, 396 + 310 * bent, 1e-6);
  }
  EXPECT_TRUE(import->notes.empty());
}

TEST(ImportVideoStitch, StereographicLens_IsFittedToItsFormula) {
  const auto import = import_project(project("ff_fisheye_opt", R"("horizontalFocal": 600)"), "one");
  ASSERT_TRUE(import) << import.error().text();
  const auto head = *geometry::Head::make(import->calibration.heads[0]);
  for (const double a : {0.2, 0.7, 1.3}) {
    const auto right = head.project(geometry::Ray::towards(std::sin(a), 0, std::cos(a)));
    ASSERT_TRUE(right);
    EXPECT_NEAR(right->x, 500 + 600 * std::tan(a / 2), 0.01);
  }
}

TEST(ImportVideoStitch, TurnedHead_LooksWhereItsAnglesSay) {
  const auto import =
      import_project(project("rectilinear", R"("horizontalFocal": 600, "yaw": 90, "pitch": 30)"), "one");
  ASSERT_TRUE(import) << import.error().text();
  const auto axis = geometry::Head::make(import->calibration.heads[0])->axis().direction();
  EXPECT_NEAR(axis.x(), std::cos(30 * kRadiansPerDegree), 1e-12);
  EXPECT_NEAR(axis.y(), -0.5, 1e-12);  // up
}

TEST(ImportVideoStitch, TranslatedHead_SeesItsSphereAsTheirFormulaSays) {
  std::string text = project("rectilinear", R"("horizontalFocal": 600, "yaw": 40, "pitch": -20, "roll": 10,
                 "translation_x": 0.05, "translation_y": -0.02, "translation_z": -0.1)");
  const std::string inputs = R"("inputs")";
  text.replace(text.find(inputs), inputs.size(), R"("spherescale": 1.5, "inputs")");
  const auto import = import_project(text, "one");
  ASSERT_TRUE(import) << import.error().text();
  EXPECT_EQ(import->calibration.distance, 1.5);
  const geometry::Head head = geometry::make_heads(import->calibration)->front();
  for (const geometry::Ray& ray : {geometry::Ray::towards(0.6, 0.4, 1), geometry::Ray::towards(0.8, 0, 1)}) {
    const Eigen::Vector3d p = 1.5 * (head.R_head_rig() * ray.direction()) + Eigen::Vector3d(0.05, -0.02, -0.1);
    const auto pixel = head.project(ray);
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x, head.calibration().center_x + 600 * p.x() / p.z(), 1e-6);
    EXPECT_NEAR(pixel->y, head.calibration().center_y + 600 * p.y() / p.z(), 1e-6);
  }
  EXPECT_NE(import->notes.back().find("meet at 1.5 m"), std::string::npos) << import->notes.back();
}

std::vector<double> point_angles(const ImportResult& import) {
  const auto heads = *geometry::make_heads(import.calibration);
  std::vector<double> angles;
  for (const ControlPoint& p : import.control_points) {
    const auto a = heads[p.head_a].unproject(p.pixel_a);
    const auto b = heads[p.head_b].unproject(p.pixel_b);
    if (a && b) angles.push_back(geometry::angle_between(*a, *b) / kRadiansPerDegree);
  }
  std::ranges::sort(angles);
  return angles;
}

TEST(ImportVideoStitch, RooftopRig_ItsOwnMatchedPointsAgree) {
  NODAL_SHARED_FILE_OR_SKIP(ptv, "stitchem_3cam/3_Cam_Sample_-_Project.ptv");
  const auto import = import_project(ptv, "rooftop");
  ASSERT_TRUE(import) << import.error().text();
  EXPECT_EQ(import->calibration.heads.size(), 3u);
  const std::vector<double> angles = point_angles(*import);
  ASSERT_EQ(angles.size(), 137u);
  RecordProperty("median_deg", std::to_string(angles[68]));
  // A wrong sign or focal length would give tens of degrees.
  EXPECT_LT(angles[68], 0.3);
  EXPECT_LT(angles[123], 0.8);
}

TEST(ImportVideoStitch, RooftopRig_IsTheSameRigAsPtguiMeasured) {
  NODAL_SHARED_FILE_OR_SKIP(ptv, "stitchem_3cam/3_Cam_Sample_-_Project.ptv");
  NODAL_SHARED_FILE_OR_SKIP(pts, "stitchem_3cam/3_Cam_-_Sample.pts");
  const auto a = import_project(ptv, "ptv");
  const auto b = import_project(pts, "pts");
  ASSERT_TRUE(a && b);
  const auto difference = calibration::difference_of(a->calibration, b->calibration);
  ASSERT_TRUE(difference) << difference.error().text();
  // The two programs' lens centres differ by 50 px, which is 3 degrees of rotation; the rays of a pixel agree
  // better.
  EXPECT_LT(difference->turned_rms_deg, 4);
  for (const calibration::HeadDifference& head : difference->heads) EXPECT_LT(head.turned_deg, 5) << head.name;
}

TEST(ImportVideoStitch, OtherRealProjects_AreRead) {
  NODAL_SHARED_FILE_OR_SKIP(orah, "calibrations/orah4i_AQ1610012338_pano.ptv");
  NODAL_SHARED_FILE_OR_SKIP(louvre, "calibrations/louvre.ptv");
  const auto four = import_project(orah, "orah");
  ASSERT_TRUE(four) << four.error().text();
  ASSERT_EQ(four->calibration.heads.size(), 4u);
  ASSERT_TRUE(four->calibration.heads[0].region.circle);
  EXPECT_NEAR(four->calibration.heads[0].region.circle->radius, 1031, 1e-9);
  EXPECT_EQ(four->calibration.distance, 3);
  const auto placed = geometry::make_heads(four->calibration);
  ASSERT_TRUE(placed);
  for (const geometry::Head& head : *placed) {
    const auto& at = head.calibration().position;
    // This camera has a body of 8 cm with a lens on each side.
    EXPECT_NEAR(head.axis().direction().dot(Eigen::Vector3d(at[0], at[1], at[2])), 0.0365, 0.001) << head.name();
  }
  const auto heads = *geometry::make_heads(four->calibration);
  // Four heads a quarter turn apart, like the product.
  EXPECT_NEAR(geometry::angle_between(heads[0].axis(), heads[1].axis()) / kRadiansPerDegree, 143.7, 1);
  const auto six = import_project(louvre, "louvre");
  ASSERT_TRUE(six) << six.error().text();
  EXPECT_EQ(six->calibration.heads.size(), 6u);
}

TEST(ImportVideoStitch, BrokenProjects_AreRefusedWithTheField) {
  for (const auto& [text, word] : std::vector<std::pair<std::string, std::string>>{
           {"{\"pano\": {}}", "'inputs'"},
           {"{\"pano\": {\"inputs\": []}}", "0 cameras"},
           {project("mercator", "\"horizontalFocal\": 300"), "mercator"},
           {project("ff_fisheye", ""), "horizontalFocal"},
           {project("ff_fisheye", "\"horizontalFocal\": -3"), "1 to 1000000"},
           {project("ff_fisheye", "\"horizontalFocal\": 300, \"yaw\": \"x\""), "'yaw'"},
           {"{\"pano\": {\"inputs\": [", "not JSON"}}) {
    const auto refused = import_project(text, "one");
    ASSERT_FALSE(refused) << text;
    EXPECT_NE(refused.error().message.find(word), std::string::npos) << refused.error().text();
  }
}

}  // namespace
}  // namespace nodal::interchange
