// OCamCalib's cameras, by the toolbox's cam2world formula written here, against the heads imported from their files.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <string>

#include "stitch/geometry/head.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

/// A fisheye of about 185 degrees, 1280 x 800.
struct Camera {
  std::vector<double> f{-400.0, 0.0, 8.0e-4, -4.0e-7, 1.1e-9};
  double row0 = 392.6, column0 = 655.2, c = 1.0006, d = 2e-4, e = -1e-4;

  std::string text() const {
    std::string numbers = std::to_string(f.size());
    char word[40];
    for (const double k : f) {
      std::snprintf(word, sizeof word, " %.12e", k);
      numbers += word;
    }
    std::snprintf(word, sizeof word, "%.9f %.9f", row0, column0);
    std::string centre = word;
    std::snprintf(word, sizeof word, "%.9f %.9f %.9f", c, d, e);
    return "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB).\n\n" + numbers +
           " \n\n#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB).\n\n3 1 2 "
           "3\n\n"
           "#center: \"row\" and \"column\", starting from 0 (C convention)\n\n" +
           centre + "\n\n#affine parameters \"c\", \"d\", \"e\"\n\n" + word +
           "\n\n#image size: \"height\" and \"width\"\n\n800 1280\n\n";
  }

  /// The toolbox's cam2world of pixel (row, column), turned from its axes (down, right, backwards) to Nodal's.
  Eigen::Vector3d ray(double row, double column) const {
    const double inverse = 1 / (c - d * e);
    const double x = inverse * ((row - row0) - d * (column - column0));
    const double y = inverse * (-e * (row - row0) + c * (column - column0));
    const double r = std::hypot(x, y);
    double z = 0, power = 1;
    for (const double k : f) z += k * power, power *= r;
    return Eigen::Vector3d(y, x, -z).normalized();
  }
};

void expect_head(const Camera& camera, double most_px) {
  const auto imported = import_project(camera.text(), "cam");
  ASSERT_TRUE(imported) << imported.error().text();
  ASSERT_EQ(imported->calibration.heads.size(), 1U);
  const HeadCalibration& calibration = imported->calibration.heads[0];
  EXPECT_EQ(calibration.width, 1280);
  EXPECT_EQ(calibration.height, 800);
  const auto head = geometry::Head::make(calibration);
  ASSERT_TRUE(head) << head.error().text();
  int seen = 0;
  for (int row = 20; row < 800; row += 19) {
    for (int column = 20; column < 1280; column += 23) {
      const auto pixel = head->project(geometry::Ray::towards(camera.ray(row, column)));
      if (!pixel || !head->contains({column + 0.5, row + 0.5})) continue;
      ++seen;
      EXPECT_NEAR(pixel->x - 0.5, column, most_px) << row << "," << column;
      EXPECT_NEAR(pixel->y - 0.5, row, most_px) << row << "," << column;
    }
  }
  EXPECT_GT(seen, 1500);
}

TEST(Ocam, Fisheye_IsWhereTheToolboxPutsRays) { expect_head(Camera(), 0.1); }

TEST(Ocam, TurnedAndStretchedPixels_AreToo) {
  Camera camera;
  camera.c = 1.04;
  camera.d = 0.003;
  camera.e = -0.003;  // a turn, which is a rotation of the head
  expect_head(camera, 0.15);
}

TEST(Ocam, ALensThatFolds_IsUsedUpToThere) {
  Camera camera;
  camera.f = {-400, 0, 0, 0, -4e-9};  // depth grows again from about 350 px on
  const auto imported = import_project(camera.text(), "cam");
  ASSERT_TRUE(imported) << imported.error().text();
  ASSERT_TRUE(imported->calibration.heads[0].region.circle.has_value());
  // Angles rise while r f'(r) > f(r): 4e-9 * 3 r^4 < 400.
  const double end = std::pow(400 / (3 * 4e-9), 0.25);
  EXPECT_NEAR(imported->calibration.heads[0].region.circle->radius, end, 2);
}

TEST(Ocam, SeveralFiles_MakeOneRig) {
  const std::vector<CameraFile> files{{"a/front.txt", Camera().text()}, {"a/back.txt", Camera().text()}};
  const auto imported = import_cameras(files, "two");
  ASSERT_TRUE(imported) << imported.error().text();
  ASSERT_EQ(imported->calibration.heads.size(), 2U);
  EXPECT_EQ(imported->calibration.heads[0].name, "front");
  EXPECT_EQ(imported->calibration.heads[1].name, "back");
}

TEST(Ocam, WrongFiles_AreOneErrorThatNamesTheLine) {
  const std::string good = Camera().text();
  const auto refused = [&](const std::string& from, const std::string& to, const std::string& says) {
    std::string text = good;
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    const auto imported = import_project(text, "cam");
    ASSERT_FALSE(imported) << to;
    EXPECT_NE(imported.error().message.find(says), std::string::npos) << imported.error().text();
  };
  refused("800 1280", "800", "line 19: the picture's size is a height and a width");
  refused("800 1280", "800 0", "width");
  refused("800 1280", "800 1e300", "width");
  refused("5 -4", "6 -4", "line 3: the number of coefficients");
  refused("5 -4", "5 4", "line 3: the first coefficient must be negative");
  refused("5 -4", "5 -nan -4", "line 3: '-nan' is no number");
  refused("5 -4", "5 x -4", "line 3: 'x' is no number");
  refused("392.6", "-392.6", "line 11: the centre is not in the picture");
  refused("1.000600000", "0.000000000", "line 15: c must be about 1");
  refused("0.000200000 -0.000100000", "1e300 -1e300", "line 15: c must be about 1");
  refused("5 -4.0", "5 -1e-300 -1e308 1 1 1 \n#", "angles do not rise");
  refused("800 1280", "", "this one 4");
  for (std::size_t cut = 0; cut < good.size(); cut += 7) {
    const auto imported = import_project(good.substr(0, cut), "cam");
    if (cut + 12 < good.size()) {
      EXPECT_FALSE(imported) << cut;
    }
  }
}

}  // namespace
}  // namespace nodal::interchange
