#include "tests/bench/registration_rig.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "hal/sim/scene/scene.h"
#include "tests/reference/png_file.h"
#include "tests/support/rendered_rig.h"

namespace nodal::bench {
namespace {

constexpr int kHeads = 10, kWidth = 720, kHeight = 480;
constexpr double kVignettingRadius = 423;

// The town square without its movers, so that the true sphere can be rendered separately.
class Still final : public hal::sim::Scene {
 public:
  explicit Still(hal::sim::ScenePtr scene) : scene_(std::move(scene)) {}
  hal::sim::Light light(const hal::sim::Direction& from, double footprint_rad) const override {
    return scene_->light(from, footprint_rad);
  }

 private:
  hal::sim::ScenePtr scene_;
};

// Evenly spread over the sphere on a spiral, each with a random roll.
Eigen::Matrix3d stand_of(int head, std::mt19937_64& random) {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0)), height = 1 - (2 * head + 1.0) / kHeads;
  const double across = std::sqrt(1 - height * height), turn = golden * head;
  const Eigen::Vector3d axis(across * std::sin(turn), -height, across * std::cos(turn));
  std::uniform_real_distribution<double> roll(-std::numbers::pi, std::numbers::pi);
  const Eigen::Quaterniond to_axis = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), axis);
  return (to_axis * Eigen::AngleAxisd(roll(random), Eigen::Vector3d::UnitZ())).toRotationMatrix().transpose();
}

Calibration rig_of(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Calibration rig;
  rig.name = "rendered";
  for (int h = 0; h < kHeads; ++h) {
    HeadCalibration head;
    head.name = "cam" + std::to_string(h);
    head.width = kWidth;
    head.height = kHeight;
    head.center_x = 364.5 + 6 * unit(random);
    head.center_y = 226.5 + 6 * unit(random);
    head.aspect = 1.083;
    head.lens = TsaiLens{490 * (1 + 0.01 * unit(random)), 2.29e-6 * (1 + 0.03 * unit(random)),
                         1.65e-11 * (1 + 0.03 * unit(random))};
    const Eigen::Matrix3d R = stand_of(h, random);
    for (int k = 0; k < 9; ++k) head.R_head_rig[static_cast<std::size_t>(k)] = R(k / 3, k % 3);
    head.region = {0, 0, kWidth, kHeight, {}};
    head.vignetting = {head.center_x, head.center_y, kVignettingRadius, {-0.2, -0.08, 0}};
    const double gain = 0.85 * (1 + 0.15 * unit(random));
    head.gain = {gain, gain, gain};
    rig.heads.push_back(head);
  }
  return rig;
}

nlohmann::ordered_json truth_of(const Calibration& rig) {
  nlohmann::ordered_json cameras = nlohmann::ordered_json::array();
  for (const HeadCalibration& head : rig.heads) {
    const auto& lens = std::get<TsaiLens>(head.lens);
    cameras.push_back({{"image", head.name + ".png"},
                       {"width", head.width},
                       {"height", head.height},
                       {"f", lens.focal},
                       {"ay", head.aspect},
                       {"cx", head.center_x - 0.5},
                       {"cy", head.center_y - 0.5},
                       {"k1", lens.kappa1},
                       {"k2", lens.kappa2},
                       {"gain", head.gain[0]},
                       {"v2", head.vignetting.coefficients[0]},
                       {"v4", head.vignetting.coefficients[1]},
                       {"R", head.R_head_rig}});
  }
  return {{"convention", "as the reference set's: pixel centres at integers"}, {"cameras", cameras}};
}

void render_row(const hal::sim::Scene& scene, test::Picture& sphere, int y) {
  constexpr int kSamples = 3;
  const double step = std::numbers::pi / sphere.height;
  for (int x = 0; x < sphere.width; ++x) {
    double sum[3] = {};
    for (int k = 0; k < kSamples * kSamples; ++k) {
      const double theta = ((x + (k % kSamples + 0.5) / kSamples) / sphere.width - 0.5) * 2 * std::numbers::pi;
      const double phi = ((y + (k / kSamples + 0.5) / kSamples) / sphere.height - 0.5) * std::numbers::pi;
      const hal::sim::Light light = scene.light(
          {std::sin(theta) * std::cos(phi), std::sin(phi), std::cos(theta) * std::cos(phi)}, step / kSamples);
      sum[0] += static_cast<double>(light.r);
      sum[1] += static_cast<double>(light.g);
      sum[2] += static_cast<double>(light.b);
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const double level = std::clamp(0.85 * 255 * sum[c] / (kSamples * kSamples), 0.0, 255.0);
      sphere
          .bytes[(static_cast<std::size_t>(y) * static_cast<std::size_t>(sphere.width) + static_cast<std::size_t>(x)) *
                     3 +
                 c] = static_cast<std::uint8_t>(std::lround(level));
    }
  }
}

void must_write(const std::filesystem::path& file, const test::Picture& picture) {
  if (const Status written = test::write_png(file, picture); !written) {
    std::fprintf(stderr, "registration_tool: %s: %s\n", file.c_str(), written.error().text().c_str());
    std::exit(1);
  }
}

}  // namespace

void render_set(const std::filesystem::path& folder, std::uint64_t seed) {
  std::filesystem::create_directories(folder);
  const Calibration rig = rig_of(seed);
  const auto scene = std::make_shared<Still>(hal::sim::town_square_scene(seed));
  test::RenderOptions options;
  options.format = PixelFormat::kRgb24;
  options.noise_levels = 1.5;
  options.seed = seed;
  const test::RenderedRig rendered = test::render_rig(rig, scene, options);
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    test::Picture picture(PixelFormat::kRgb24, kWidth, kHeight);
    picture.bytes = rendered.bytes[h];
    must_write(folder / (rig.heads[h].name + ".png"), picture);
  }
  test::Picture sphere(PixelFormat::kRgb24, 2048, 1024);
  for (int y = 0; y < sphere.height; ++y) render_row(*scene, sphere, y);
  must_write(folder / "gt_equirect_2048.png", sphere);
  std::ofstream(folder / "rig_gt.json") << truth_of(rig).dump(1);
}

}  // namespace nodal::bench
