// Pictures without a calibration: real rigs against what people measured, a rendered one against its truth.
#include "host_tool/input/own_pictures.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include "stitch/geometry/lens/lens.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/import.h"
#include "tests/data/truth_rig.h"
#include "tests/support/rendered_rig.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

const OwnProgress kSilent = [](double, const std::string&) {};

class OwnPictures : public testing::Test {
 protected:
  static fs::path data(const std::string& name) { return fs::path(NODAL_SHARED_DIR) / "data" / name; }
  void need(const fs::path& file) {
    if (!fs::exists(file)) GTEST_SKIP() << file << " is not there";
  }
  static std::string text_of(const fs::path& file) {
    std::ifstream stream(file);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
};

Eigen::Vector3d up_in_head(const HeadCalibration& head) {
  return geometry::matrix_of(head.R_head_rig) * Eigen::Vector3d(0, -1, 0);
}

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

Result<RigPictures> calibrated(const std::vector<std::string>& files) {
  Result<RigPictures> own = own_pictures(files);
  if (!own) return own;
  if (const auto placed = calibrate_by_pictures(*own, {}, kSilent); !placed) return fail(placed.error());
  return own;
}

TEST_F(OwnPictures, Synthetic10head_RotationsFromNothing) {
  const fs::path folder = data("synthetic_10head");
  need(folder / "rig_gt.json");
  if (IsSkipped()) return;
  const auto truth = test_data::read_truth_rig(text_of(folder / "rig_gt.json"));
  ASSERT_TRUE(truth) << truth.error().text();
  std::vector<std::string> files;
  for (const std::string& image : truth->images) files.push_back((folder / image).string());
  const auto first = calibrated(files);
  ASSERT_TRUE(first) << first.error().text();
  ASSERT_EQ(first->files().at(0), files);
  // Every head has a lens of its own there, up to 1 % apart, and matching knows only one for all.
  EXPECT_LT(test::rotation_error(truth->calibration, first->calibration).max_deg, 1.5);
  const auto report = refined(*first, kSilent);
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_LT(test::rotation_error(truth->calibration, report->calibration).rms_deg, 0.02);
}

TEST_F(OwnPictures, APictureOfSomethingElse_IsLeftOutAndNamed) {
  const fs::path folder = data("synthetic_10head"), other = data("stitchem_3cam") / "input-00.jpg";
  need(folder / "cam0.png");
  need(other);
  if (IsSkipped()) return;
  std::vector<std::string> files;
  for (int h = 0; h < 10; ++h) files.push_back((folder / ("cam" + std::to_string(h) + ".png")).string());
  files.insert(files.begin() + 4, other.string());
  const auto first = calibrated(files);
  ASSERT_TRUE(first) << first.error().text();
  EXPECT_EQ(first->heads.size(), 10U);
  ASSERT_EQ(first->notes.size(), 2U) << "the picture, and no edges to tell what is up";
  EXPECT_NE(first->notes[0].find("input-00.jpg is left out"), std::string::npos) << first->notes[0];
}

TEST_F(OwnPictures, Stitchem3cam_StandsUprightAsItsOwnersLevelledIt) {
  const fs::path folder = data("stitchem_3cam"), project = folder / "3_Cam_-_Sample.pts";
  need(project);
  if (IsSkipped()) return;
  const auto owners = interchange::import_project(text_of(project), "rooftop");
  ASSERT_TRUE(owners) << owners.error().text();
  std::vector<std::string> files;
  for (int h = 0; h < 3; ++h) files.push_back((folder / ("input-0" + std::to_string(h) + ".jpg")).string());
  const auto first = calibrated(files);
  ASSERT_TRUE(first) << first.error().text();
  ASSERT_EQ(first->heads.size(), 3U);
  for (std::size_t h = 0; h < 3; ++h) {
    EXPECT_LT(degrees_between(up_in_head(first->calibration.heads[h]), up_in_head(owners->calibration.heads[h])), 4)
        << h;
    EXPECT_NEAR(first->calibration.heads[h].center_x, owners->calibration.heads[h].center_x, 30) << h;
    EXPECT_NEAR(first->calibration.heads[h].center_y, owners->calibration.heads[h].center_y, 30) << h;
  }
  // The heads' brightness differs, most of all towards their rims.
  const auto report = refined(*first, kSilent);
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_LT(report->objective_after, 0.6 * report->objective_before);
}

TEST_F(OwnPictures, GoproFusion_FieldOfViewAndHorizon) {
  const fs::path folder = data("gopro_fusion") / "testframes" / "3k" / "single";
  const fs::path front = folder / "FR" / "GPFR0003_img1.jpg", back = folder / "BK" / "GPBK0003_img1.jpg";
  need(front);
  if (IsSkipped()) return;
  const auto first = calibrated({front.string(), back.string()});
  ASSERT_TRUE(first) << first.error().text();
  ASSERT_EQ(first->heads.size(), 2U);
  const HeadCalibration& head = first->calibration.heads[0];
  // The maker's parameters: 190 degrees at a radius of 765 px about (779, 742).
  const double at_circle = *geometry::Lens::make(head.lens).value().angle(765) * 360 / std::numbers::pi;
  EXPECT_NEAR(at_circle, 190, 5);
  // The pictures share some degrees at their rims: nothing else of the lens counts as known.
  const FoundLens& lens = first->match->lens;
  EXPECT_FALSE(lens.whole);
  EXPECT_GT(lens.known.from_deg, 75);
  EXPECT_LT(lens.known.to_px, 760) << "no point is farther out than 740 px";
  EXPECT_NE(lens.note.find("° from its axis"), std::string::npos) << lens.note;
  EXPECT_NE(first->calibration.comment.find("elsewhere it is assumed to be equidistant"), std::string::npos);
  EXPECT_EQ(std::ranges::count(first->notes, lens.note), 1);
  EXPECT_NEAR(head.center_x, 779, 15);
  EXPECT_NEAR(head.center_y, 742, 15);
  // Six points of the horizon, read off the maker's own stitch, lie on a circle about this direction.
  const Eigen::Vector3d up(0.256, -0.374, 0.891);
  EXPECT_LT(degrees_between(up_in_head(head), up), 8);
  const auto other_order = calibrated({back.string(), front.string()});
  ASSERT_TRUE(other_order) << other_order.error().text();
  EXPECT_LT(degrees_between(up_in_head(other_order->calibration.heads[1]), up), 8);
}

}  // namespace
}  // namespace nodal::host
