// `nodal stitch` with one file that holds two circles, as 360-degree cameras write it.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "stitch/geometry/rotation.h"
#include "stitch/media/image_file.h"
#include "stitch_command.h"

namespace nodal::command_line {
namespace {

using Picture = std::vector<std::uint8_t>;  // RGB, square
constexpr int kPair = 640;

/// Two fisheyes back to back. `radii`: of the circles, px; what is larger than half the side is cut by the edges.
test::RenderedRig pair_of(std::array<double, 2> radii) {
  Calibration rig = test::six_fisheyes(kPair, 196);
  rig.heads = {rig.heads[0], rig.heads[2]};
  for (std::size_t h = 0; h < 2; ++h) {
    HeadCalibration& head = rig.heads[h];
    head.name = h == 0 ? "left" : "right";
    head.region.circle = Region::Circle{kPair / 2.0 + 3, kPair / 2.0 - 2, radii[h]};
    head.center_x = head.region.circle->x;
    head.center_y = head.region.circle->y;
    head.max_angle = 98 * std::numbers::pi / 180;
    head.lens = EquidistantLens{{radii[h] / head.max_angle}};
  }
  test::RenderedRig made = test::render_rig(rig, hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 0, 5, 3});
  for (std::size_t h = 0; h < 2; ++h) {
    for (int i = 0; i < kPair * kPair; ++i) {
      const double from_middle = std::hypot(i % kPair + 0.5 - kPair / 2.0 - 3, i / kPair + 0.5 - kPair / 2.0 + 2);
      if (from_middle >= radii[h]) std::fill_n(made.bytes[h].begin() + std::ptrdiff_t{3} * i, 3, std::uint8_t{3});
    }
  }
  return made;
}

/// Turned by a quarter, as its camera was turned clockwise: what was up is at the left.
Picture quarter_turned(const Picture& picture) {
  Picture turned(picture.size());
  for (int y = 0; y < kPair; ++y) {
    for (int x = 0; x < kPair; ++x)
      std::copy_n(picture.begin() + 3 * (x * kPair + kPair - 1 - y), 3, turned.begin() + 3 * (y * kPair + x));
  }
  return turned;
}

Picture beside(const Picture& a, const Picture& b) {
  Picture both;
  for (int y = 0; y < kPair; ++y) {
    for (const Picture* one : {&a, &b})
      both.insert(both.end(), one->begin() + 3 * kPair * y, one->begin() + 3 * kPair * (y + 1));
  }
  return both;
}

/// How far the rotation from the first head to the second is from this one, degrees.
double error_deg(const Calibration& found, const Eigen::Matrix3d& R_second_first) {
  const auto R = [&](std::size_t h) { return geometry::matrix_of(found.heads[h].R_head_rig); };
  return Eigen::AngleAxisd(R(1) * R(0).transpose() * R_second_first.transpose()).angle() * 180 / std::numbers::pi;
}

class OneFile : public StitchCommand {
 protected:
  void write_file_of(const Picture& both, bool stacked) const {
    test::write_bytes(path("both.png"),
                      test::png_of(both, stacked ? kPair : 2 * kPair, stacked ? 2 * kPair : kPair, 3));
  }
  Calibration found(const Words& more = {}) {
    Words words{"stitch", path("both.png"), "--width", "512", "-o", path("sphere.png"), "--overwrite"};
    words.insert(words.end(), more.begin(), more.end());
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE((run.out + run.err).find("2 of 2 pictures placed"), std::string::npos) << run.out << run.err;
    return parse_calibration(read("sphere.rig.json")).value();
  }
};

TEST_F(OneFile, TwoCircles_AreFoundAndPlaced) {
  const test::RenderedRig pair = pair_of({310, 310});
  const Eigen::Matrix3d back = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY()).toRotationMatrix();
  write_file_of(beside(pair.bytes[0], pair.bytes[1]), false);
  const Calibration rig = found();
  ASSERT_EQ(rig.heads.size(), 2U);
  EXPECT_EQ(rig.heads[0].name, "left");
  EXPECT_EQ(rig.heads[0].width, kPair);
  EXPECT_LT(error_deg(rig, back), 1.5);
  // The calibration serves for the next file, which is split without being told.
  const Finished again =
      nodal({"stitch", path("sphere.rig.json"), path("both.png"), "--width", "512", "-o", path("again.png")});
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(read("again.png"), read("sphere.png"));
  // The halves become files that a rig replays.
  const Finished rig_of_it =
      nodal({"register", path("both.png"), "-o", path("r.json"), "--rig-toml", path("halves.toml")});
  ASSERT_EQ(rig_of_it.code, 0) << rig_of_it.err;
  EXPECT_NE(read("halves.toml").find("port = \"replay:halves.right.png\""), std::string::npos) << read("halves.toml");
  EXPECT_EQ(media::read_image(path("halves.left.png"), PixelFormat::kRgb24)->bytes, pair.bytes[0]);
  EXPECT_EQ(media::read_image(path("halves.right.png"), PixelFormat::kRgb24)->bytes, pair.bytes[1]);
  // One above the other, and by the data sheet.
  Picture stacked = pair.bytes[0];
  stacked.insert(stacked.end(), pair.bytes[1].begin(), pair.bytes[1].end());
  write_file_of(stacked, true);
  EXPECT_EQ(found().heads[1].name, "bottom");
  EXPECT_EQ(nodal({"stitch", "--nominal", "2x196", path("both.png"), "-o", path("sheet.png")}).code, 0);
}

TEST_F(OneFile, CirclesThatAreTurnedOrCut_ArePlacedToo) {
  // The halves of a Theta's file lie on their sides, one turned against the other.
  const test::RenderedRig pair = pair_of({310, 310});
  const Eigen::Matrix3d back = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const Eigen::Matrix3d quarter = geometry::to_R_head_rig({0, 0, 90});
  const Picture second = quarter_turned(quarter_turned(quarter_turned(pair.bytes[1])));
  write_file_of(beside(quarter_turned(pair.bytes[0]), second), false);
  EXPECT_LT(error_deg(found(), quarter.transpose() * back * quarter.transpose()), 1.5);
  const test::RenderedRig cut = pair_of({345, 345});  // 25 px are missing at each edge
  write_file_of(beside(cut.bytes[0], cut.bytes[1]), false);
  EXPECT_LT(error_deg(found(), back), 1.5);
}

TEST_F(OneFile, CirclesOfDifferentSize_AreEachTakenForAWholeLens) {
  const test::RenderedRig pair = pair_of({310, 250});
  write_file_of(beside(pair.bytes[0], pair.bytes[1]), false);
  const Calibration rig = found();
  EXPECT_LT(error_deg(rig, Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY()).toRotationMatrix()), 1.5);
  const auto focal = [&](std::size_t h) { return std::get<KannalaBrandtLens>(rig.heads[h].lens).focal; };
  EXPECT_NEAR(focal(1) / focal(0), 250.0 / 310, 0.02);
}

TEST_F(OneFile, OtherArrangements_AreRefusedOrAsTheUserSays) {
  write_pictures("pictures");
  Picture grid;  // 3 x 2 pictures
  for (int row = 0; row < 2; ++row) {
    for (int y = 0; y < kSide; ++y) {
      for (std::size_t column = 0; column < 3; ++column) {
        const auto from = town().bytes[static_cast<std::size_t>(row) * 3 + column].begin() + 3 * kSide * y;
        grid.insert(grid.end(), from, from + 3 * kSide);
      }
    }
  }
  test::write_bytes(path("grid.png"), test::png_of(grid, 3 * kSide, 2 * kSide, 3));
  ASSERT_EQ(nodal({"stitch", path("rig.json"), path("grid.png"), "--split", "3x2", "-o", path("grid_sphere.png")}).code,
            0);
  ASSERT_EQ(nodal({"stitch", path("rig.json"), path("pictures"), "-o", path("sphere.png")}).code, 0);
  EXPECT_EQ(read("grid_sphere.png"), read("sphere.png"));
  const std::string one = path("pictures/" + name_of(0) + ".png");
  expect_refused({path("grid.png"), "-o", path("no.png")}, "--split 2x1");
  expect_refused({one, "-o", path("no.png")}, "is one picture");
  expect_refused({path("rig.json"), path("grid.png"), "--split", "2x2", "-o", path("no.png")},
                 "4 pictures in a file (2x2) for 6 heads");
  expect_refused({path("rig.json"), path("grid.png"), "-o", path("no.png")}, "1 picture for 6 heads");
  for (const char* nonsense : {"", "2", "0x2", "1x1", "9x1", "2x1x1", "-2x1", "2x", "axb", "99999999999x2"})
    expect_refused({path("grid.png"), "--split", nonsense, "-o", path("no.png")}, "--split");
  // One circle in the middle of a wide picture is no pair.
  const Picture fisheye = pair_of({300, 300}).bytes[0];
  Picture wide(static_cast<std::size_t>(3 * 1160 * kPair), 3);
  for (int y = 0; y < kPair; ++y)
    std::copy_n(fisheye.begin() + 3 * kPair * y, 3 * kPair, wide.begin() + 3 * (1160 * y + 260));
  test::write_bytes(path("wide.png"), test::png_of(wide, 1160, kPair, 3));
  expect_refused({path("wide.png"), "-o", path("no.png")}, "is one picture");
  ASSERT_EQ(nodal({"convert", path("sphere.png"), "-o", path("gpano.jpg")}).code, 0);
  expect_refused({path("gpano.jpg"), "-o", path("no.png")}, "is a sphere already");
  test::write_bytes(path("plain.png"), test::png_of(Picture(3 * 512 * 256, 90), 512, 256, 3));
  expect_refused({path("plain.png"), "-o", path("no.png")}, "--from equirectangular");
}

}  // namespace
}  // namespace nodal::command_line
