// With the same head, noise, blur, tilt and uneven light: our pattern and calibration against a chessboard and
// cv::calibrateCamera. Skipped with a message if Debian's python3-opencv is not installed.
#include <gtest/gtest.h>

#include <array>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "stitch/calibration/lens/calibrate.h"
#include "tests/support/photographer.h"

namespace nodal::calibration {
namespace {

namespace fs = std::filesystem;
namespace ph = nodal::photographer;
using nlohmann::json;

constexpr const char* kPython = "/usr/bin/python3";  // Debian's interpreter, which finds Debian's modules

bool there_is_opencv() {
  return std::system((std::string(kPython) + " -c 'import cv2, numpy' > /dev/null 2>&1").c_str()) == 0;
}

/// The paper's lens (Figure 3) on NTSC pixels.
ph::Lens peer_lens() {
  ph::Lens lens;
  lens.aspect = 1.083;
  lens.k = {2.29e-6, 1.65e-11};
  return lens;
}

ph::Shot any_light(std::uint64_t seed) {
  ph::Shot shot;
  shot.noise = 3;
  shot.blur_px = 0.6 + 0.1 * static_cast<double>(seed % 4);
  shot.light_x = 0.6;
  shot.light_y = -0.3;
  shot.light_xx = -0.8;
  shot.vignetting = {-0.3, 0.05, 0};
  shot.seed = seed;
  return shot;
}

/// The pixel of a ray; `found` projects rays, `truth` gives the ray of each pixel.
using Project = std::function<std::array<double, 2>(const std::array<double, 3>& ray)>;

struct MappingError {
  double rms = 0;
  double worst = 0;
};

/// For human readers, and for tests/bench/lens, which parses the test's report.
void tell(const std::string& method, std::size_t photographs, const MappingError& error, double seconds) {
  const json row{{"method", method},
                 {"photographs", photographs},
                 {"mapping_rms_px", error.rms},
                 {"mapping_max_px", error.worst},
                 {"seconds", seconds}};
  std::string key = "method_" + method;
  for (char& c : key) c = std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  testing::Test::RecordProperty(key, row.dump());
}

MappingError mapping_error(const ph::Lens& truth, const Project& found) {
  MappingError error;
  int count = 0;
  for (int j = 0; j < truth.height; j += 4) {
    for (int i = 0; i < truth.width; i += 4) {
      const auto pixel = found(truth.ray(i + 0.5, j + 0.5));
      const double off = std::hypot(pixel[0] - i - 0.5, pixel[1] - j - 0.5);
      error.rms += off * off;
      error.worst = std::max(error.worst, off);
      ++count;
    }
  }
  error.rms = std::sqrt(error.rms / count);
  return error;
}

MappingError ours(const ph::Lens& truth) {
  const PatternRaster pattern = *make_pattern({});
  const ph::Scene scene = ph::print_of(pattern.width, pattern.height, pattern.values);
  constexpr std::array<std::array<double, 3>, 6> kPlaces{
      {{5, 0, 0}, {30, 20, 5}, {25, 110, -10}, {30, 200, 90}, {28, 290, 175}, {20, 45, 30}}};
  std::vector<LensPhotograph> photographs;
  for (const auto& place : kPlaces) {
    ph::Shot shot = any_light(photographs.size() + 1);
    shot.tilt_deg = place[0];
    shot.tilt_about_deg = place[1];
    shot.spin_deg = place[2];
    shot.distance = 0.3;
    const ph::Photo photo = ph::take(scene, truth, shot);
    LensPhotograph out{"photo" + std::to_string(photographs.size()), GreyImage(photo.width, photo.height)};
    for (std::size_t i = 0; i < photo.grey.size(); ++i) out.luma.values[i] = static_cast<float>(photo.grey[i]) / 255.0F;
    photographs.push_back(std::move(out));
  }
  const auto start = std::chrono::steady_clock::now();
  const auto result = calibrate_lens(photographs, pattern, {});
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_TRUE(result) << (result ? "" : result.error().text());
  if (!result) return {HUGE_VAL, HUGE_VAL};
  const auto& lens = std::get<TsaiLens>(result->head.lens);
  const MappingError error = mapping_error(truth, [&](const std::array<double, 3>& ray) -> std::array<double, 2> {
    const double s = std::hypot(ray[0], ray[1]);
    double low = 0, high = 1000;
    for (int n = 0; n < 60; ++n) {
      const double r = (low + high) / 2;
      const double ideal = r * (1 + r * r * (lens.kappa1 + r * r * lens.kappa2));
      (ideal / lens.focal < s / ray[2] ? low : high) = r;
    }
    return {result->head.center_x + low * ray[0] / s, result->head.center_y + result->head.aspect * low * ray[1] / s};
  });
  tell("nodal", photographs.size(), error, seconds.count());
  return error;
}

/// The best of OpenCV's distortion models.
MappingError opencvs(const ph::Lens& truth) {
  const ph::Scene scene = ph::chessboard(11, 8);
  const fs::path folder = fs::path(testing::TempDir()) / "nodal_chessboard";
  fs::create_directories(folder);
  // More than twice as many photographs as ours, with all corners of the board inside each and the board in every part
  // of the picture, as OpenCV's manual recommends. Tilt, axis of the tilt, spin, x, y, distance.
  constexpr std::array<std::array<double, 6>, 15> kPlaces{{{5, 0, 0, 0, -0.02, 0.72},
                                                           {25, 20, 3, 0, 0, 0.75},
                                                           {25, 110, -5, 0.03, 0.0, 0.75},
                                                           {25, 200, 4, -0.05, 0, 0.75},
                                                           {25, 290, -3, 0, 0, 0.8},
                                                           {20, 45, 0, 0.45, 0.14, 0.95},
                                                           {20, 135, 0, -0.45, 0.14, 0.95},
                                                           {20, 225, 0, 0.45, -0.16, 0.95},
                                                           {20, 315, 0, -0.45, -0.16, 0.95},
                                                           {30, 0, 90, 0, 0, 1.0},
                                                           {35, 60, 0, 0.2, 0.1, 0.9},
                                                           {35, 240, 0, -0.2, -0.1, 0.9},
                                                           {25, 0, 0, 0.55, 0, 0.9},
                                                           {25, 180, 0, -0.55, 0, 0.9},
                                                           {30, 150, 10, 0, 0.15, 0.9}}};
  std::string command =
      std::string(kPython) + " " + NODAL_SOURCE_DIR + "/tests/unit/stitch_calibration_lens/opencv_chessboard.py 10 7";
  for (std::size_t n = 0; n < kPlaces.size(); ++n) {
    ph::Shot shot = any_light(n + 1);
    shot.light_xx = -0.4;
    shot.tilt_deg = kPlaces[n][0];
    shot.tilt_about_deg = kPlaces[n][1];
    shot.spin_deg = kPlaces[n][2];
    shot.x = kPlaces[n][3];
    shot.y = kPlaces[n][4];
    shot.distance = kPlaces[n][5];
    const ph::Photo photo = ph::take(scene, truth, shot);
    const fs::path file = folder / ("board" + std::to_string(n) + ".pgm");
    std::ofstream(file, std::ios::binary) << "P5\n"
                                          << photo.width << " " << photo.height << "\n255\n"
                                          << std::string(photo.grey.begin(), photo.grey.end());
    command += " " + file.string();
  }
  EXPECT_EQ(std::system((command + " > " + (folder / "out.json").string()).c_str()), 0);
  std::ifstream in(folder / "out.json");
  const json out = json::parse(in, nullptr, false);
  fs::remove_all(folder);
  EXPECT_FALSE(out.is_discarded());
  if (out.is_discarded()) return {};
  EXPECT_GE(out["boards"].get<int>(), 12);
  MappingError best{HUGE_VAL, HUGE_VAL};
  for (const auto& [model, camera] : out["cameras"].items()) {
    const auto K = camera["K"].get<std::vector<double>>();
    auto k = camera["distortion"].get<std::vector<double>>();
    k.resize(14, 0.0);
    const MappingError error = mapping_error(truth, [&](const std::array<double, 3>& ray) -> std::array<double, 2> {
      const double x = ray[0] / ray[2], y = ray[1] / ray[2], s = x * x + y * y;
      const double radial = (1 + s * (k[0] + s * (k[1] + s * k[4]))) / (1 + s * (k[5] + s * (k[6] + s * k[7])));
      return {K[0] * (x * radial + 2 * k[2] * x * y + k[3] * (s + 2 * x * x)) + K[2] + 0.5,
              K[4] * (y * radial + k[2] * (s + 2 * y * y) + 2 * k[3] * x * y) + K[5] + 0.5};
    });
    tell("opencv " + out["version"].get<std::string>() + " " + model, out["boards"].get<std::size_t>(), error,
         camera["seconds"].get<double>());
    if (error.rms < best.rms) best = error;
  }
  return best;
}

TEST(PeerOpenCv, SameHeadSameLight_OurMappingErrorIsSmallAndAtMostHalfOfItsOwn) {
  const ph::Lens truth = peer_lens();
  const MappingError mine = ours(truth);
  EXPECT_LE(mine.rms, 0.03);
  if (!there_is_opencv()) GTEST_SKIP() << "python3-opencv is not installed: compared with no peer";
  const MappingError theirs = opencvs(truth);
  EXPECT_LE(mine.rms, theirs.rms / 2);
}

}  // namespace
}  // namespace nodal::calibration
