// OpenCV's and Kalibr's lenses, by their formulas written here, against the heads imported from their files.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <optional>

#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::string opencv(const std::string& k, const std::string& extra = "") {
  return "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n" + extra +
         "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
         "   data: [ 500., 0., 321.25, 0., 510.5, 236.75, 0., 0., 1. ]\n"
         "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ " +
         k + " ]\n";
}

/// OpenCV's pixel (centres at integers) of a point in front of the camera; calib3d's documentation.
Vector2d opencv_project(const std::vector<double>& k, const Vector3d& p) {
  const auto at = [&](std::size_t i) { return i < k.size() ? k[i] : 0.0; };
  const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y;
  const double radial = (1 + at(0) * r2 + at(1) * r2 * r2 + at(4) * r2 * r2 * r2) /
                        (1 + at(5) * r2 + at(6) * r2 * r2 + at(7) * r2 * r2 * r2);
  const double xd = x * radial + 2 * at(2) * x * y + at(3) * (r2 + 2 * x * x);
  const double yd = y * radial + at(2) * (r2 + 2 * y * y) + 2 * at(3) * x * y;
  return {500 * xd + 321.25, 510.5 * yd + 236.75};
}

/// The largest distance and the rms, over the picture, between head and formula.
struct Off {
  double most = 0, rms = 0;
};
template <class Project>
Off off_from(const HeadCalibration& calibration, double farthest_deg, Project project) {
  const auto head = geometry::Head::make(calibration);
  EXPECT_TRUE(head) << (head ? "" : head.error().text());
  Off off;
  int count = 0;
  for (int i = 1; i <= 60; ++i) {
    for (int n = 0; n < 36; ++n) {
      const double a = farthest_deg * std::numbers::pi / 180 * i / 60, turn = n * std::numbers::pi / 18;
      const Vector3d ray(std::sin(a) * std::cos(turn), std::sin(a) * std::sin(turn), std::cos(a));
      const Vector2d truth = project(ray);
      if (truth.x() < 0 || truth.y() < 0 || truth.x() > 639 || truth.y() > 479) continue;
      const auto pixel = head->project(geometry::Ray::towards(ray));
      EXPECT_TRUE(pixel);
      if (!pixel) continue;
      const double d = std::hypot(pixel->x - 0.5 - truth.x(), pixel->y - 0.5 - truth.y());
      off.most = std::max(off.most, d);
      off.rms += d * d;
      ++count;
    }
  }
  off.rms = std::sqrt(off.rms / count);
  EXPECT_GT(count, 500);
  return off;
}

TEST(ImportOpenCv, PlumbBob_IsExact) {
  const std::vector<double> k{-0.28, 0.09, 0, 0, -0.012};
  const auto import = import_project(opencv("-0.28, 9.0e-02, 0., 0., -0.012"), "cam");
  ASSERT_TRUE(import) << import.error().text();
  const Off off = off_from(import->calibration.heads[0], 38, [&](const Vector3d& p) { return opencv_project(k, p); });
  EXPECT_LT(off.most, 1e-9);
  EXPECT_TRUE(import->notes.empty());
}

TEST(ImportOpenCv, RationalModel_IsFittedAsNearlyAsTheNoteSays) {
  const std::vector<double> k{0.6, 0.05, 0, 0, 0.002, 0.95, 0.2, 0.01};
  const auto import = import_project(opencv("0.6, 0.05, 0., 0., 0.002, 0.95, 0.2, 0.01"), "cam");
  ASSERT_TRUE(import) << import.error().text();
  const Off off = off_from(import->calibration.heads[0], 45, [&](const Vector3d& p) { return opencv_project(k, p); });
  EXPECT_LT(off.most, 0.2);
  EXPECT_LT(off.rms, 0.05);
}

TEST(ImportOpenCv, TangentialTerms_BecomeAShiftAndATurnAndTheRestIsTold) {
  const std::vector<double> k{-0.2, 0.05, 0.001, -0.0008};
  const auto import = import_project(opencv("-0.2, 0.05, 0.001, -0.0008"), "cam");
  ASSERT_TRUE(import) << import.error().text();
  const Off off = off_from(import->calibration.heads[0], 36, [&](const Vector3d& p) { return opencv_project(k, p); });
  EXPECT_LT(off.rms, 0.2);
  // Their omission would cost pixels: 2 p1 x y f is 0.4 px in the corners, p1 3 y^2 f is 0.3 px.
  ASSERT_FALSE(import->notes.empty());
  EXPECT_NE(import->notes[0].find("tangential"), std::string::npos);
  EXPECT_NE(import->notes[0].find("px rms"), std::string::npos);
}

TEST(ImportOpenCv, Fisheye_IsExactAndToldByItsField) {
  const auto import = import_project(opencv("-0.01, 0.02, -0.005, 0.001", "fisheye_model: 1\n"), "cam");
  ASSERT_TRUE(import) << import.error().text();
  const Off off = off_from(import->calibration.heads[0], 40, [](const Vector3d& p) -> Vector2d {
    // cv::fisheye's documentation: theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
    const double a = p.x() / p.z(), b = p.y() / p.z(), r = std::hypot(a, b), t = std::atan(r);
    const double td = t * (1 - 0.01 * t * t + 0.02 * std::pow(t, 4) - 0.005 * std::pow(t, 6) + 0.001 * std::pow(t, 8));
    return {500 * td / r * a + 321.25, 510.5 * td / r * b + 236.75};
  });
  EXPECT_LT(off.most, 1e-9);
}

TEST(ImportOpenCv, BrokenFiles_AreRefusedWithTheField) {
  for (const auto& [text, word] :
       std::vector<std::pair<std::string, std::string>>{{"%YAML:1.0\n---\nimage_width: 640\n", "image_height"},
                                                        {opencv("0, 0, 0, 0, 0, 0, 0"), "7 distortion coefficients"},
                                                        {opencv("abc"), "list of numbers"},
                                                        {"%YAML:1.0\n---\nfoo: [1, 2\n", "not YAML"},
                                                        {"%YAML:1.0\n---\nimage_width: 64000000\n", "1 to 32768"}}) {
    const auto refused = import_project(text, "cam");
    ASSERT_FALSE(refused) << text;
    EXPECT_NE(refused.error().message.find(word), std::string::npos) << refused.error().text();
  }
}

TEST(ImportOpenCvCameras, AFileEach_AreHeadsInTheOrderGivenEachWithItsOwnLens) {
  const std::vector<CameraFile> files{{"rigs/left.yaml", opencv("-0.28, 0.09, 0., 0., -0.012")},
                                      {"rigs/right.yaml", opencv("-0.1, 0.02, 0., 0., 0.")},
                                      {"up.yaml", opencv("-0.01, 0.02, -0.005, 0.001", "fisheye_model: 1\n")}};
  const auto import = import_cameras(files, "tripod");
  ASSERT_TRUE(import) << import.error().text();
  EXPECT_EQ(import->calibration.name, "tripod");
  ASSERT_EQ(import->calibration.heads.size(), 3u);
  EXPECT_EQ(import->images.size(), 3u);
  const std::vector<std::vector<double>> k{{-0.28, 0.09, 0, 0, -0.012}, {-0.1, 0.02}};
  for (std::size_t h = 0; h < 2; ++h) {
    const Off off =
        off_from(import->calibration.heads[h], 38, [&](const Vector3d& p) { return opencv_project(k[h], p); });
    EXPECT_LT(off.most, 1e-9) << h;
  }
  EXPECT_TRUE(std::holds_alternative<KannalaBrandtLens>(import->calibration.heads[2].lens));
  EXPECT_EQ(import->calibration.heads[0].name, "left");
  EXPECT_EQ(import->calibration.heads[1].name, "right");
  EXPECT_EQ(import->calibration.heads[2].name, "up");
  ASSERT_EQ(import->notes.size(), 1u);
  EXPECT_NE(import->notes[0].find("nodal pairs"), std::string::npos);
}

TEST(ImportOpenCvCameras, TwoOfOneName_TheSecondIsCalledAsItsFile) {
  // ROS gives every camera this name.
  const std::string camera = opencv("-0.1, 0.02, 0., 0., 0.", "camera_name: narrow_stereo\n");
  const auto import = import_cameras(std::vector<CameraFile>{{"a/front.yaml", camera}, {"b/back.yaml", camera}}, "r");
  ASSERT_TRUE(import) << import.error().text();
  EXPECT_EQ(import->calibration.heads[0].name, "narrow_stereo");
  EXPECT_EQ(import->calibration.heads[1].name, "back");
}

TEST(ImportOpenCvCameras, BadOnes_AreRefusedWithTheFile) {
  const CameraFile good{"good.yaml", opencv("-0.1, 0.02, 0., 0., 0.")};
  const std::vector<std::pair<std::vector<CameraFile>, std::string>> bad{
      {{good, {"dir/short.yaml", opencv("0, 0, 0, 0, 0, 0, 0")}}, "dir/short.yaml: "},
      {{good, {"rig.pto", "p f2 w100\ni w640 h480 f0 v50\n"}}, "rig.pto: it is no camera of OpenCV or OCamCalib"},
      {std::vector<CameraFile>(65, good), "65 cameras"}};
  for (const auto& [files, words] : bad) {
    const auto refused = import_cameras(files, "r");
    ASSERT_FALSE(refused) << words;
    EXPECT_NE(refused.error().message.find(words), std::string::npos) << refused.error().text();
  }
}

std::string kalibr_camera(int n, const std::string& model, const std::string& intrinsics, const std::string& distortion,
                          const std::string& coefficients, const std::string& T = "") {
  return "cam" + std::to_string(n) + ":\n" + T + "  camera_model: " + model + "\n  intrinsics: [" + intrinsics +
         "]\n  distortion_model: " + distortion + "\n  distortion_coeffs: [" + coefficients +
         "]\n  resolution: [640, 480]\n  rostopic: /cam" + std::to_string(n) + "/image_raw\n";
}

TEST(ImportKalibr, ChainOfThree_MultipliesItsRotations) {
  // 90 degrees to the right, then 90 degrees up: the third camera looks in the second's up direction.
  const std::string right = "  T_cn_cnm1:\n  - [0, 0, -1, 0.1]\n  - [0, 1, 0, 0]\n  - [1, 0, 0, 0]\n  - [0, 0, 0, 1]\n";
  const std::string up = "  T_cn_cnm1:\n  - [1, 0, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, -1, 0, 0]\n  - [0, 0, 0, 1]\n";
  const std::string lens = "500, 500, 319.5, 239.5";
  const auto import = import_project(kalibr_camera(0, "pinhole", lens, "radtan", "0, 0, 0, 0") +
                                         kalibr_camera(1, "pinhole", lens, "equidistant", "0, 0, 0, 0", right) +
                                         kalibr_camera(2, "pinhole", lens, "none", "", up),
                                     "chain");
  ASSERT_TRUE(import) << import.error().text();
  ASSERT_EQ(import->calibration.heads.size(), 3u);
  const auto heads = *geometry::make_heads(import->calibration);
  EXPECT_LT((heads[0].axis().direction() - Vector3d(0, 0, 1)).norm(), 1e-9);
  EXPECT_LT((heads[1].axis().direction() - Vector3d(1, 0, 0)).norm(), 1e-9);
  EXPECT_LT((heads[2].axis().direction() - Vector3d(0, -1, 0)).norm(), 1e-9);
  EXPECT_NEAR(import->calibration.heads[0].center_x, 320, 1e-12);
  // x1 = R x0 + (0.1, 0, 0): the second camera is 0.1 m in front of the first, and the third with it.
  const std::array<double, 3> z{-0.2 / 3, 0.1 / 3, 0.1 / 3};
  for (std::size_t h = 0; h < 3; ++h) {
    const auto& at = import->calibration.heads[h].position;
    EXPECT_LT((Vector3d(at[0], at[1], at[2]) - Vector3d(0, 0, z[h])).norm(), 1e-12) << h;
  }
  EXPECT_NE(import->notes.at(0).find("0.06667 m from the rig's nodal point"), std::string::npos) << import->notes.at(0);
}

TEST(ImportKalibr, OmniEucmAndDoubleSphere_AreFittedToTheirFormulas) {
  struct Model {
    std::string name, intrinsics;
    std::function<Vector2d(const Vector3d&)> unit;  // before focal lengths
  };
  const std::vector<Model> models{
      {"omni", "1.2, 700, 710, 320, 240",
       [](const Vector3d& p) -> Vector2d { return p.head<2>() / (p.z() + 1.2 * p.norm()); }},
      {"eucm", "0.6, 1.1, 300, 310, 320, 240",
       [](const Vector3d& p) -> Vector2d {
         const double d = std::sqrt(1.1 * p.head<2>().squaredNorm() + p.z() * p.z());
         return p.head<2>() / (0.6 * d + 0.4 * p.z());
       }},
      {"ds", "-0.2, 0.55, 250, 255, 320, 240", [](const Vector3d& p) -> Vector2d {
         const double d1 = p.norm(), z = -0.2 * d1 + p.z();
         const double d2 = std::sqrt(p.head<2>().squaredNorm() + z * z);
         return p.head<2>() / (0.55 * d2 + 0.45 * z);
       }}};
  for (const Model& model : models) {
    const auto import = import_project(kalibr_camera(0, model.name, model.intrinsics, "none", ""), "cam");
    ASSERT_TRUE(import) << import.error().text();
    const double fx = model.name == "omni" ? 700 : model.name == "eucm" ? 300 : 250;
    const double fy = model.name == "omni" ? 710 : model.name == "eucm" ? 310 : 255;
    const Off off = off_from(import->calibration.heads[0], 60, [&](const Vector3d& p) -> Vector2d {
      return model.unit(p).cwiseProduct(Vector2d(fx, fy)) + Vector2d(320, 240);
    });
    EXPECT_LT(off.most, 0.3) << model.name;
  }
}

TEST(ImportKalibr, WhatKalibrDoesNotWrite_IsRefusedWithTheCamera) {
  const std::string T = "  T_cn_cnm1:\n  - [1, 0, 0, 0]\n  - [0, 2, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n";
  const std::string lens = "500, 500, 319.5, 239.5";
  for (const auto& [text, word] : std::vector<std::pair<std::string, std::string>>{
           {kalibr_camera(0, "pinhole", lens, "bent", "0"), "distortion_model 'bent'"},
           {kalibr_camera(0, "catfish", lens, "none", ""), "camera_model 'catfish'"},
           {kalibr_camera(0, "pinhole", "500, 500", "none", ""), "4 numbers"},
           {kalibr_camera(0, "pinhole", lens, "none", "", T), "T_cn_cnm1"},
           {"cam1:\n  distortion_model: cam0\n", "no 'cam0'"}}) {
    const auto refused = import_project(text, "chain");
    ASSERT_FALSE(refused) << text;
    EXPECT_NE(refused.error().message.find(word), std::string::npos) << refused.error().text();
  }
}

}  // namespace
}  // namespace nodal::interchange
