// Heads that are placed by hand in the page of `nodal look`: a rendered rig, and what the page says of it.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string>

#include "page_driver.h"
#include "protocol/calibration.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {

inline constexpr double kRadians = std::numbers::pi / 180;  // one degree
inline constexpr int kSide = 256;

class HeadsPage : public PageDriver {
 protected:
  /// Six fisheyes in a town, and a calibration in which each is turned by `least` to `most` degrees.
  Words write_rig(double least, double most, unsigned seed = 3) {
    rig_ = test::render_rig(test::six_fisheyes(kSide), hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 0, 5, 3});
    Words words{path("prior.json")};
    for (std::size_t k = 0; k < rig_.bytes.size(); ++k) {
      const std::string name = rig_.truth.heads[k].name + ".png";
      test::write_bytes(path(name), test::png_of(rig_.bytes[k], kSide, kSide, 3));
      words.push_back(path(name));
    }
    std::ofstream(path("prior.json")) << to_json((prior_ = test::turned(rig_.truth, least, most, seed)));
    words.insert(words.end(), {"-o", path("placed.json")});
    return words;
  }
  static Eigen::Matrix3d axes(const Json& head) {
    Eigen::Matrix3d R;
    for (int k = 0; k < 9; ++k) R(k / 3, k % 3) = head["axes"][static_cast<std::size_t>(k)];
    return R;
  }
  /// The direction that a view without yaw or pitch shows at a pixel.
  static Eigen::Vector3d ray(const Json& state, double x, double y) {
    const double width = state["width"], height = state["height"];
    const double focal = width / 2 / std::tan(state["fov"].get<double>() / 2 * kRadians);
    return Eigen::Vector3d(x - width / 2, height / 2 - y, -focal).normalized();
  }

  const Json size_{"size", 1000, 900}, slide_{"select", "tool", 1};
  test::RenderedRig rig_;
  Calibration prior_;
};

}  // namespace nodal::command_line
