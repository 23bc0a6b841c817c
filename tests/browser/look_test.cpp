// The page of `nodal look` in headless Chromium, beside the views that `nodal view` makes.
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "page_driver.h"
#include "stitch/geometry/raymap/registry.h"
#include "stitch/media/image_file.h"
#include "tests/support/layouts.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using test::Finished;
using test::Process;
using Words = std::vector<std::string>;

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kWindow = 800;  // px, wide and high

/// Whole pixels, from the middle, that a perspective camera with this focal length shows 30 degrees apart, within 0.02.
std::pair<int, int> thirty_degrees_apart(double focal) {
  const int half = kWindow / 2;
  std::pair<int, int> best{0, 0};
  double off = 1;
  for (int a = -half + 20; a < 0; ++a) {
    for (int b = 1; b < half - 20; ++b) {
      const double error = std::abs((std::atan(b / focal) - std::atan(a / focal)) / kDegree - 30);
      if (error < off) best = {a, b}, off = error;
    }
  }
  EXPECT_LT(off, 0.02);
  return best;
}

class LookPage : public PageDriver {
 protected:
  /// Runs the command that the page shows, and compares its picture with a screenshot: dB. Pixels within `beside` px of
  /// black, the surroundings of an envelope, do not count.
  double psnr_with_view(const Json& state, const std::string& shot, int beside = 0) const {
    Words words;
    std::istringstream command(state["command"].get<std::string>());
    for (std::string word; command >> word;) words.push_back(word == "view.png" ? path("view.png") : word);
    words.erase(words.begin());
    words.insert(words.end(), {"--filter", "bilinear", "--overwrite"});
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
    return psnr_of(path("view.png"), path(shot), beside);
  }
  static double psnr_of(const std::string& a, const std::string& b, int beside) {
    const DecodedImage one = media::read_image(a, PixelFormat::kRgb24).value();
    const DecodedImage other = media::read_image(b, PixelFormat::kRgb24).value();
    EXPECT_EQ(one.width, other.width);
    EXPECT_EQ(one.height, other.height);
    if (one.bytes.size() != other.bytes.size()) return 0;
    const auto dark = [&](int x, int y) {
      const auto at = static_cast<std::size_t>(y * one.width + x) * 3;
      return one.bytes[at] + one.bytes[at + 1] + one.bytes[at + 2] < 30;
    };
    const auto counts = [&](int x, int y) {
      for (int j = y - beside; beside > 0 && j <= y + beside; j += beside)
        for (int i = x - beside; i <= x + beside; i += beside)
          if (i < 0 || j < 0 || i >= one.width || j >= one.height || dark(i, j)) return false;
      return true;
    };
    double sum = 0;
    std::size_t count = 0;
    for (int y = 0; y < one.height; ++y) {
      for (int x = 0; x < one.width; ++x) {
        if (!counts(x, y)) continue;
        for (std::size_t c = 0; c < 3; ++c, ++count) {
          const auto at = static_cast<std::size_t>(y * one.width + x) * 3 + c;
          const double difference = double{one.bytes[at] * 1.0} - other.bytes[at];
          sum += difference * difference;
        }
      }
    }
    EXPECT_GT(count, one.bytes.size() / 8);
    return 10 * std::log10(255.0 * 255.0 / std::max(1e-9, sum / static_cast<double>(count)));
  }
  const Json size_{"size", kWindow, kWindow};
};

TEST_F(LookPage, Drag30Degrees_ViewTurns30Degrees_ForEveryLayout) {
  write_sphere("sphere.png", 1024);
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    if (!test::holds_whole_sphere(kind)) continue;
    const std::string layout(kind.name), file = layout + ".png";
    const bool scattered = kind.name == "stratified_random" || kind.name == "hammersley" || kind.name == "halton";
    ASSERT_EQ(nodal({"convert", path("sphere.png"), "--from", "equirectangular", "-o", path(file), "--layout", layout,
                     "--width", scattered ? "512" : "1024", "--overwrite"})
                  .code,
              0);
    // A new page is 75 degrees wide.
    const auto [from, to] = thirty_degrees_apart(kWindow / 2 / std::tan(75 * kDegree / 2));
    const std::vector<Json> seen =
        drive({path(file), "--from", layout}, {size_,
                                               {"open"},
                                               {"state"},
                                               {"drag", kWindow / 2 + from, nullptr, kWindow / 2 + to, nullptr},
                                               {"state"},
                                               {"shot", "after.png"}});
    ASSERT_EQ(seen.size(), 3u) << layout;
    const Json &before = seen[1], &after = seen[2];
    ASSERT_EQ(before["width"], kWindow) << layout;
    EXPECT_NEAR(before["fov"].get<double>(), 75, 1e-9) << layout;
    EXPECT_NEAR(after["yaw"].get<double>(), -30, 0.1) << layout << ": what is dragged to the right leaves there";
    EXPECT_NEAR(after["pitch"].get<double>(), 0, 0.1) << layout;
    EXPECT_GE(psnr_with_view(after, "after.png"), 40) << layout;
    EXPECT_LT(psnr_with_view(before, "after.png"), 30) << layout << ": the view before is another one";
  }
}

TEST_F(LookPage, FromOutside_TheSameDragTurnsTheOtherWay) {
  write_sphere("sphere.png", 1024);
  const Json outside{"select", "side", 1}, up{"key", "ArrowUp"}, focus{"drag", 400, 300, 400, 300};
  Json steps{size_, {"open"}, outside, focus, up, up, up, up, {"state"}};
  const std::vector<Json> before = drive({path("sphere.png"), "--from", "equirectangular"}, steps);
  const double width = before.at(1)["width"], height = before.at(1)["height"];
  EXPECT_NEAR(before[1]["pitch"].get<double>(), 0, 0.2);
  // A point of the unit sphere, 15 degrees beside the middle as the centre sees it, from 3 radii away.
  const double focal = width / 2 / std::tan(before[1]["fov"].get<double>() / 2 * kDegree);
  const double beside = focal * std::sin(15 * kDegree) / (3 - std::cos(15 * kDegree));
  steps.erase(steps.size() - 1);
  for (const Json& step : {Json{"drag", width / 2 - beside, height / 2, width / 2 + beside, height / 2}, Json{"state"},
                           Json{"shot", "outside.png"}})
    steps.push_back(step);
  const std::vector<Json> after = drive({path("sphere.png"), "--from", "equirectangular"}, steps);
  EXPECT_NEAR(after.at(1)["yaw"].get<double>() - before[1]["yaw"].get<double>(), 30, 0.25) << "a pixel is 0.2 degrees";
  EXPECT_GE(psnr_with_view(after[1], "outside.png", 3), 40);
}

TEST_F(LookPage, EveryEnvelope_LooksTheSameFromTheNodalPoint) {
  write_sphere("sphere.png", 1024);
  Json steps{size_, {"open"}, {"select", "projection", 1}};
  for (int k = 0; k < 7; ++k) {  // the last is the soup of triangles
    steps.push_back({"select", "envelope", k});
    steps.push_back({"shot", "envelope" + std::to_string(k) + ".png"});
  }
  drive({path("sphere.png"), "--from", "equirectangular"}, steps);
  const DecodedImage sphere = media::read_image(path("envelope0.png"), PixelFormat::kRgb24).value();
  for (int k = 1; k < 7; ++k) {
    const DecodedImage other =
        media::read_image(path("envelope" + std::to_string(k) + ".png"), PixelFormat::kRgb24).value();
    double sum = 0;
    for (std::size_t i = 0; i < sphere.bytes.size(); ++i) sum += std::abs(sphere.bytes[i] - other.bytes[i]);
    EXPECT_LE(sum / static_cast<double>(sphere.bytes.size()), 1) << "levels on average, envelope " << k;
  }
}

TEST_F(LookPage, EachProjection_IsTheViewOfNodalView_AlsoOfAnOwnEnvelope) {
  write_sphere("sphere.png", 1024);
  ASSERT_EQ(
      nodal({"mesh", "--size", "64x32", "--error", "5", "--envelope", "octahedron:1", "-o", path("own.obj")}).code, 0);
  Json steps{size_, {"open"}, {"drag", 400, 300, 430, 380}};
  for (int k = 0; k < 3; ++k) {
    steps.push_back({"select", "projection", k});
    steps.push_back({"state"});
    steps.push_back({"shot", "projection" + std::to_string(k) + ".png"});
  }
  steps.push_back({"select", "projection", 0});
  steps.push_back({"select", "side", 1});
  steps.push_back({"state"});
  steps.push_back({"shot", "own.png"});
  const std::vector<Json> seen =
      drive({path("sphere.png"), "--from", "equirectangular", "--envelope", path("own.obj")}, steps);
  ASSERT_EQ(seen.size(), 5u);
  EXPECT_GE(psnr_with_view(seen[1], "projection0.png"), 40);
  EXPECT_GE(psnr_with_view(seen[2], "projection1.png"), 40);
  EXPECT_GE(psnr_with_view(seen[3], "projection2.png"), 40);
  EXPECT_NE(seen[4]["command"].get<std::string>().find("own.obj"), std::string::npos);
  EXPECT_GE(psnr_with_view(seen[4], "own.png", 4), 30) << "edges between faces are nearly the same";
}

TEST_F(LookPage, TheEyeMoves_AsNodalViewHasItAndWithinTheShapeOnly) {
  write_sphere("sphere.png", 1024);
  const Json cube{"select", "envelope", 1}, fisheye{"select", "projection", 1}, drag{"drag", 400, 300, 430, 380};
  const Json ahead{"key", "w"}, left{"key", "a"}, up{"key", "r"}, state{"state"};
  const Json away{"press", "#name"}, focus{"drag", 400, 300, 400, 300};  // what has the focus has a frame in pictures
  Json steps{size_, {"open"}, cube, drag, ahead, ahead, left, up, state, away, {"shot", "moved.png"}};
  for (const Json& step : {fisheye, state, Json{"shot", "moved_fisheye.png"}, focus}) steps.push_back(step);
  for (int k = 0; k < 40; ++k) steps.push_back(left);
  for (const Json& step : {state, Json{"select", "envelope", 6}, state, focus, Json{"key", "Home"}, state}) {
    steps.push_back(step);
  }
  const std::vector<Json> seen = drive({path("sphere.png"), "--from", "equirectangular"}, steps);
  ASSERT_EQ(seen.size(), 6u);
  EXPECT_NE(seen[1]["command"].get<std::string>().find("--eye"), std::string::npos);
  EXPECT_GE(psnr_with_view(seen[1], "moved.png"), 40) << seen[1];
  EXPECT_GE(psnr_with_view(seen[2], "moved_fisheye.png"), 38) << "by way of a cube around the eye";
  EXPECT_NE(seen[3]["message"].get<std::string>().find("outside of the shape"), std::string::npos) << seen[3];
  EXPECT_NE(seen[4]["message"].get<std::string>().find("Loose triangles"), std::string::npos) << seen[4];
  EXPECT_EQ(seen[5]["message"], "");
}

TEST_F(LookPage, KeysWheelAndPinch_TurnAndZoom) {
  write_sphere("sphere.png", 256);
  const Json state{"state"};
  const std::vector<Json> seen = drive({path("sphere.png"), "--from", "equirectangular"}, {size_,
                                                                                           {"open"},
                                                                                           {"key", "Tab"},
                                                                                           state,
                                                                                           {"key", "ArrowRight"},
                                                                                           {"key", "Shift+ArrowUp"},
                                                                                           state,
                                                                                           {"key", "+"},
                                                                                           state,
                                                                                           {"key", "i"},
                                                                                           state,
                                                                                           {"key", "i"},
                                                                                           {"key", "p"},
                                                                                           state,
                                                                                           {"key", "Home"},
                                                                                           state,
                                                                                           {"wheel", 400},
                                                                                           state,
                                                                                           {"pinch", 100, 200},
                                                                                           state});
  ASSERT_EQ(seen.size(), 9u);
  EXPECT_EQ(seen[1]["focus"], "view") << "the first stop of the Tab key";
  EXPECT_NEAR(seen[2]["yaw"].get<double>(), 5, 1e-9);
  EXPECT_NEAR(seen[2]["pitch"].get<double>(), 0.5, 1e-9);
  EXPECT_NEAR(seen[3]["fov"].get<double>(), seen[2]["fov"].get<double>() / 1.15, 1e-9);
  EXPECT_NE(seen[4]["command"].get<std::string>().find("--eye"), std::string::npos);
  EXPECT_NE(seen[5]["command"].get<std::string>().find("--camera fisheye"), std::string::npos);
  EXPECT_NEAR(seen[6]["yaw"].get<double>(), 0, 1e-9);
  EXPECT_GT(seen[7]["fov"].get<double>(), seen[6]["fov"].get<double>() * 1.2);
  EXPECT_NEAR(seen[8]["fov"].get<double>(), seen[7]["fov"].get<double>() / 2, 1) << "fingers twice as far apart";
}

TEST_F(LookPage, ACameraPathOfKeys_IsOneThatNodalViewReads) {
  write_sphere("sphere.png", 256);
  const std::vector<Json> seen = drive(
      {path("sphere.png"), "--from", "equirectangular"},
      {size_, {"open"}, {"key", "Tab"}, {"key", "k"}, {"key", "ArrowRight"}, {"key", "+"}, {"key", "k"}, {"state"}});
  const std::string csv = seen.at(1)["path"];
  EXPECT_TRUE(csv.starts_with("picture,yaw,pitch,roll,fov\n0,0,0,0,75\n60,5,0,0,65.2174\n")) << csv;
  test::write_bytes(path("path.csv"), {csv.begin(), csv.end()});
  const Finished views = nodal({"view", path("sphere.png"), "--from", "equirectangular", "--size", "32x32", "--path",
                                path("path.csv"), "-o", path("v-%d.png")});
  EXPECT_EQ(views.code, 0) << views.err;
  EXPECT_TRUE(fs::exists(path("v-60.png")));
}

TEST_F(LookPage, InLargeAndSmallWindows_ItIsAccessibleFitsAndAsksNobodyElse) {
  write_sphere("sphere.png", 256);
  const std::vector<Json> seen = drive({path("sphere.png"), "--from", "equirectangular"}, {{"size", 1400, 900},
                                                                                           {"open"},
                                                                                           {"axe"},
                                                                                           {"shot", "1400.png", "page"},
                                                                                           {"details"},
                                                                                           {"axe"},
                                                                                           {"size", 320, 568},
                                                                                           {"axe"},
                                                                                           {"state"},
                                                                                           {"shot", "320.png", "page"},
                                                                                           {"requests"}});
  ASSERT_EQ(seen.size(), 6u);
  for (const int k : {1, 2, 3}) EXPECT_EQ(seen[static_cast<std::size_t>(k)], Json::array()) << "axe-core's violations";
  EXPECT_EQ(seen[4]["wider"], 0) << "nothing is beside a window of 320 px";
  EXPECT_EQ(seen[5]["errors"], Json::array());
  for (const Json& url : seen[5]["requests"])
    EXPECT_TRUE(url.get<std::string>().starts_with("http://127.0.0.1:")) << url;
}

TEST_F(LookPage, WithoutWebGl_TheRaymapIsShownFlatAndTheReasonIsSaid) {
  write_sphere("sphere.png", 256);
  const Words words{path("sphere.png"), "--from", "equirectangular"};
  const std::vector<Json> none = drive(words, {size_, {"graphics", "none", 0}, {"open"}, {"state"}, {"axe"}});
  EXPECT_NE(none.at(1)["message"].get<std::string>().find("no WebGL"), std::string::npos) << none[1];
  EXPECT_EQ(none[1]["flat"], 256);
  EXPECT_EQ(none.at(2), Json::array());
  const std::vector<Json> lost = drive(words, {size_, {"open"}, {"loseGraphics"}, {"state"}});
  EXPECT_NE(lost.at(1)["message"].get<std::string>().find("WebGL was lost"), std::string::npos) << lost[1];
  EXPECT_EQ(lost[1]["flat"], 256);
}

TEST_F(LookPage, APictureLargerThanTheGraphicsTake_IsShownSmallerAndSaysSo) {
  write_sphere("sphere.png", 512);
  const std::vector<Json> seen = drive({path("sphere.png"), "--from", "equirectangular"},
                                       {size_, {"graphics", "small", 256}, {"open"}, {"state"}});
  EXPECT_NE(seen.at(1)["notes"].get<std::string>().find("256x128 of its 512x256 px"), std::string::npos) << seen[1];
  EXPECT_EQ(seen[1]["message"], "");
}

TEST_F(LookPage, RaysWithoutOrder_TooMany_AreShownFlat) {
  write_sphere("sphere.png", 1024);  // as if its pixels were in another order
  const std::vector<Json> seen =
      drive({path("sphere.png"), "--from", "halton"}, {size_, {"open"}, {"state"}, {"shot", "flat.png", "page"}});
  EXPECT_NE(seen.at(1)["message"].get<std::string>().find("524288 rays"), std::string::npos) << seen[1];
  EXPECT_EQ(seen[1]["flat"], 1024);
}

}  // namespace
}  // namespace nodal::command_line
