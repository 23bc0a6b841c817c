// The page of `nodal look` turned by a phone's motion and by an emulated headset.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "page_driver.h"
#include "protocol/base/angles.h"
#include "stitch/media/image_file.h"

namespace nodal::command_line {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kEye = 400;  // px, wide and high

class Sensors : public PageDriver {
 protected:
  void SetUp() override {
    PageDriver::SetUp();
    if (IsSkipped()) return;
    if (in_firefox()) GTEST_SKIP() << "motion is emulated by Chromium's own protocol";
    write_sphere("sphere.png", 1024);
  }
  std::vector<Json> drive_sphere(const Json& steps) const {
    return drive({path("sphere.png"), "--from", "equirectangular"}, steps);
  }
  /// The axes of a view (right, up, backward) as columns, in a world with y up and -z ahead.
  static Matrix3d view_of(const Json& state) {
    const auto angle = [&](const char* name) { return state[name].get<double>() * kRadiansPerDegree; };
    return (AngleAxisd(-angle("yaw"), Vector3d::UnitY()) * AngleAxisd(angle("pitch"), Vector3d::UnitX()) *
            AngleAxisd(-angle("roll"), Vector3d::UnitZ()))
        .toRotationMatrix();
  }
  /// The same of a device by the W3C's definition of alpha, beta and gamma (z, then x, then y), and of the page that is
  /// turned on it; the earth's axes are east, north and up.
  static Matrix3d device(double alpha, double beta, double gamma, double screen) {
    Matrix3d world;  // axes of the earth in those of views: x east, y up, z south
    world << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    return (world * AngleAxisd(alpha * kRadiansPerDegree, Vector3d::UnitZ()) *
            AngleAxisd(beta * kRadiansPerDegree, Vector3d::UnitX()) *
            AngleAxisd(gamma * kRadiansPerDegree, Vector3d::UnitY()) *
            AngleAxisd(-screen * kRadiansPerDegree, Vector3d::UnitZ()));
  }
  /// Compares part of a screenshot with `nodal view`: dB.
  double psnr(const std::string& shot, int left, const Words& view) const {
    Words words{"view",           path("sphere.png"), "--from",   "equirectangular", "-o",
                path("view.png"), "--filter",         "bilinear", "--overwrite"};
    words.insert(words.end(), view.begin(), view.end());
    const test::Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
    const DecodedImage one = media::read_image(path("view.png"), PixelFormat::kRgb24).value();
    const DecodedImage all = media::read_image(path(shot), PixelFormat::kRgb24).value();
    double sum = 0;
    for (int y = 0; y < one.height; ++y) {
      for (int x = 0; x < 3 * one.width; ++x) {
        const double is = all.bytes.at(static_cast<std::size_t>(3 * (y * all.width + left) + x));
        const double difference = is - one.bytes[static_cast<std::size_t>(3 * y * one.width + x)];
        sum += difference * difference;
      }
    }
    return 10 * std::log10(255 * 255 * 3.0 * one.width * one.height / std::max(1e-9, sum));
  }
};

TEST_F(Sensors, Gyroscope_PhoneTurns_ViewFollows) {
  struct Held {
    double alpha, beta, gamma, screen;
  };
  // Upright, turned by 40 degrees, tilted, rolled, and with the page turned on the phone.
  const std::vector<Held> all{{10, 90, 0, 0}, {50, 90, 0, 0}, {50, 60, 0, 0}, {350, 80, 25, 0}, {80, 20, -60, 90}};
  Json steps{{"size", 800, 600}, {"device", ""}, {"open"}, {"press", "#gyroscope"}};
  for (const Held& held : all) {
    steps.push_back({"orient", held.alpha, held.beta, held.gamma, held.screen});
    steps.push_back({"state"});
  }
  steps.push_back({"shot", "rolled.png"});
  steps.push_back({"drag", 500, 300, 300, 300});
  steps.push_back({"orient", 81, 20, -60, 90});
  steps.push_back({"state"});
  steps.push_back({"press", "#gyroscope"});
  steps.push_back({"orient", 10, 90, 0, 0});
  steps.push_back({"state"});
  steps.push_back({"axe"});
  const std::vector<Json> seen = drive_sphere(steps);
  ASSERT_EQ(seen.size(), all.size() + 4);
  // The first event turns the view about the vertical only: it begins where the page looked.
  const Matrix3d begin = view_of(seen[1]) * device(all[0].alpha, all[0].beta, all[0].gamma, all[0].screen).transpose();
  EXPECT_LT((begin * Vector3d::UnitY() - Vector3d::UnitY()).norm(), 1e-3);
  EXPECT_NEAR(seen[1]["yaw"].get<double>(), 0, 0.1);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Matrix3d expected = begin * device(all[k].alpha, all[k].beta, all[k].gamma, all[k].screen);
    const AngleAxisd off(Matrix3d(view_of(seen[k + 1]) * expected.transpose()));
    EXPECT_LT(off.angle() / kRadiansPerDegree, 0.1) << k << ": " << seen[k + 1];
  }
  EXPECT_NEAR(seen[2]["yaw"].get<double>(), -40, 0.1) << "alpha grows counterclockwise, as seen from above";
  EXPECT_GT(std::abs(seen[5]["roll"].get<double>()), 10);
  std::istringstream command(seen[5]["command"].get<std::string>());
  Words view;
  for (std::string word; command >> word;) view.push_back(word);
  view.erase(view.begin(), std::find(view.begin(), view.end(), "--camera"));
  EXPECT_GE(psnr("rolled.png", 0, view), 40) << "what is drawn is rolled, too";
  const double dragged = seen[6]["yaw"].get<double>() - seen[5]["yaw"].get<double>();
  EXPECT_GT(std::abs(dragged), 5) << "a drag turns it further, and the next motion does not undo that";
  EXPECT_EQ(seen[7]["roll"], 0) << "it no longer follows";
  EXPECT_EQ(seen[7]["yaw"], seen[6]["yaw"]);
  EXPECT_EQ(seen[8], Json::array()) << "axe-core's violations";
}

TEST_F(Sensors, WhatTheBrowserDoesNotAllow_IsSaidInASentence) {
  struct Case {
    std::string device, button, says;
  };
  for (const Case& each : {Case{"insecure", "#gyroscope", "over https only"}, Case{"insecure", "#headset", "https"},
                           Case{"refusing", "#gyroscope", "was not allowed"}, Case{"", "#gyroscope", "no gyroscope"},
                           Case{"", "#headset", "headset"}}) {
    const std::vector<Json> seen = drive_sphere(
        {{"size", 800, 600}, {"device", each.device}, {"open"}, {"press", each.button}, {"wait", 2000}, {"state"}});
    EXPECT_NE(seen.at(1)["message"].get<std::string>().find(each.says), std::string::npos) << each.button << seen[1];
  }
  const std::vector<Json> desk =
      drive_sphere({{"size", 800, 600}, {"open"}, {"shown", "#gyroscope"}, {"shown", "#headset"}});
  EXPECT_EQ(desk.at(1), false) << "a computer without a touch screen is not asked to turn";
  EXPECT_EQ(desk.at(2), false);
}

TEST_F(Sensors, Headset_TurnsTheView_AndBothEyesSeeTheSame) {
  const Eigen::Quaterniond turn = AngleAxisd(-35 * kRadiansPerDegree, Vector3d::UnitY()) *
                                  AngleAxisd(20 * kRadiansPerDegree, Vector3d::UnitX()) *
                                  AngleAxisd(-10 * kRadiansPerDegree, Vector3d::UnitZ());
  const Json turned{turn.x(), turn.y(), turn.z(), turn.w()}, straight{0, 0, 0, 1};
  const std::vector<Json> seen = drive_sphere({{"size", 2 * kEye, kEye},
                                               {"device", "headset"},
                                               {"open"},
                                               {"drag", 400, 100, 500, 100},
                                               {"state"},
                                               {"press", "#headset"},
                                               {"wear", {0, 1.6, 0}, straight},
                                               {"shot", "straight.png", "page"},
                                               {"wear", {0.4, 1.5, -0.3}, turned},
                                               {"shot", "turned.png", "page"},
                                               {"session"},
                                               {"state"},
                                               {"press", "#name"},
                                               {"shot", "after.png", "page"}});
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_EQ(seen[2]["message"], "");
  const double yaw = seen[1]["yaw"];
  EXPECT_LT(yaw, -3);
  const auto view = [&](double more, double pitch, double roll) {
    const auto text = [](double value) { return std::to_string(value); };
    return Words{
        "--yaw",    text(yaw + more), "--pitch", text(pitch), "--roll",
        text(roll), "--fov",          "90",      "--size",    std::to_string(kEye) + "x" + std::to_string(kEye)};
  };
  for (const int left : {0, kEye}) {
    EXPECT_GE(psnr("straight.png", left, view(0, 0, 0)), 40) << "it begins where the page looked";
    EXPECT_GE(psnr("turned.png", left, view(35, 20, 10)), 40) << "whoever walks sees the same";
    EXPECT_LT(psnr("turned.png", left, view(0, 0, 0)), 30);
  }
}

}  // namespace
}  // namespace nodal::command_line
