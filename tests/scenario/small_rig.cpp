#include "tests/scenario/small_rig.h"

#include <array>

namespace nodal::scenario {
namespace {

using Axis = std::array<double, 3>;

Axis cross(const Axis& a, const Axis& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace

Calibration small_calibration(const std::string& name) {
  // The viewing direction of each head (its z) and its picture's bottom (its y), in the rig's frame.
  const std::array<std::array<Axis, 2>, kHeads> looks = {{{{{0, 0, 1}, {0, 1, 0}}},
                                                          {{{1, 0, 0}, {0, 1, 0}}},
                                                          {{{0, 0, -1}, {0, 1, 0}}},
                                                          {{{-1, 0, 0}, {0, 1, 0}}},
                                                          {{{0, -1, 0}, {0, 0, 1}}},
                                                          {{{0, 1, 0}, {0, 0, -1}}}}};
  constexpr double kFocal = 22.4;  // 32 / tan(55 degrees)
  Calibration calibration;
  calibration.name = name;
  for (int i = 0; i < kHeads; ++i) {
    const auto& [z, y] = looks[static_cast<std::size_t>(i)];
    const Axis x = cross(y, z);
    HeadCalibration head;
    head.name = "cam" + std::to_string(i);
    head.width = head.height = kHeadSide;
    head.center_x = head.center_y = kHeadSide / 2.0;
    head.lens = RectilinearLens{{kFocal}};
    head.R_head_rig = {x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]};
    head.region = {0, 0, kHeadSide, kHeadSide, std::nullopt};
    head.vignetting = {kHeadSide / 2.0, kHeadSide / 2.0, kHeadSide / 2.0, {}};
    calibration.heads.push_back(head);
  }
  return calibration;
}

firmware::RigConfig small_config() {
  firmware::RigConfig config;
  config.name = "small";
  config.raymap.width = 128;
  config.raymap.height = 64;
  config.raymap.format = PixelFormat::kRgb24;
  config.raymap.jpeg_quality = 95;
  config.sim.emplace().calibration = "truth.json";
  for (int i = 0; i < kHeads; ++i) {
    firmware::HeadConfig head;
    head.name = "cam" + std::to_string(i);
    head.port = {firmware::PortKind::kSim, head.name};
    head.format = PixelFormat::kRgb24;
    config.heads.push_back(head);
  }
  return config;
}

}  // namespace nodal::scenario
