// Small rigs for compiling tables.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/geometry/rotation.h"

namespace nodal::test {

inline HeadCalibration head_at(const std::string& name, int width, int height, LensModel lens,
                               geometry::YawPitchRoll pose) {
  HeadCalibration head;
  head.name = name;
  head.width = width;
  head.height = height;
  head.center_x = width / 2.0;
  head.center_y = height / 2.0;
  head.lens = std::move(lens);
  head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig(pose));
  head.region = {0, 0, static_cast<double>(width), static_cast<double>(height), std::nullopt};
  head.vignetting.x = head.center_x;
  head.vignetting.y = head.center_y;
  head.vignetting.radius = width / 2.0;
  return head;
}

/// Six ideal pinholes of 106 degrees, looking out of a cube: together they cover the sphere.
inline Calibration cube_rig(int side) {
  Calibration rig;
  rig.name = "cube";
  const double focal = side / 2.0 / 1.327;  // tan 53 degrees
  const geometry::YawPitchRoll poses[] = {{0, 0, 0}, {90, 0, 0}, {180, 0, 0}, {-90, 0, 0}, {0, 90, 0}, {0, -90, 0}};
  for (const geometry::YawPitchRoll& pose : poses) {
    rig.heads.push_back(head_at("c" + std::to_string(rig.heads.size()), side, side, TsaiLens{focal, 0, 0}, pose));
  }
  return rig;
}

/// Heads with fisheyes of 200 px per radian and a field of 1.1 rad around the axis, turned by 45 degrees around it. In
/// an equirectangular raymap 768 px wide, near the axis, a tile of 8x8 pixels that are s = 1.64 samples apart is 7 s
/// sqrt(2) = 16.2 samples wide and high, and half of it 10 s / sqrt(2) = 11.6. A patch holds 14 and a part.
inline Calibration turned_fisheyes(const std::vector<double>& yaws) {
  Calibration rig;
  rig.name = "turned";
  for (const double yaw : yaws) {
    rig.heads.push_back(
        head_at("t" + std::to_string(rig.heads.size()), 700, 700, EquidistantLens{{200}}, {yaw, 0, 45}));
    rig.heads.back().region.circle = {350, 350, 220};
  }
  return rig;
}

/// One to six heads with any lens model and orientation, some with a circular region, an aspect, a decentred lens.
inline Calibration random_rig(std::mt19937& random) {
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  Calibration rig;
  rig.name = "random";
  const int count = 1 + static_cast<int>(random() % 6);
  for (int h = 0; h < count; ++h) {
    const int width = 2 * (12 + static_cast<int>(random() % 20));
    const int height = 2 * (12 + static_cast<int>(random() % 20));
    LensModel lens;
    switch (random() % 4) {
      case 0: lens = TsaiLens{uniform(0.3, 1.0) * width, uniform(0, 1e-4), 0}; break;
      case 1: lens = RectilinearLens{{uniform(0.3, 1.0) * width}}; break;
      case 2: lens = EquidistantLens{{uniform(0.2, 0.6) * width}}; break;
      default: lens = KannalaBrandtLens{uniform(0.2, 0.6) * width, {uniform(0, 0.02), 0, 0, 0}}; break;
    }
    HeadCalibration head = head_at("r" + std::to_string(h), width, height, lens,
                                   {uniform(-180, 180), uniform(-90, 90), uniform(-180, 180)});
    head.center_x += uniform(-2, 2);
    head.center_y += uniform(-2, 2);
    head.aspect = uniform(0.9, 1.1);
    if (!std::holds_alternative<TsaiLens>(head.lens)) head.max_angle = uniform(1.0, 1.5);
    if (head.lens.index() >= 2) head.max_angle *= 2;  // fisheyes see behind themselves
    if (random() % 3 == 0) head.region.circle = {head.center_x, head.center_y, uniform(0.3, 0.5) * width};
    if (random() % 4 == 0) {
      const auto corner = [&] { return Region::Point{uniform(-5, width + 5.0), uniform(-5, height + 5.0)}; };
      head.region.masks.push_back({{1, 1}, corner(), corner(), {width / 3.0, height / 4.0}});
    }
    rig.heads.push_back(std::move(head));
  }
  return rig;
}

/// The same with gains and vignetting of up to a factor of 1.6.
inline Calibration random_rig_with_light(std::mt19937& random) {
  Calibration rig = random_rig(random);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  for (HeadCalibration& head : rig.heads) {
    for (double& gain : head.gain) gain = uniform(0.85, 1.2);
    head.vignetting.radius = std::max(head.width, head.height);
    head.vignetting.coefficients = {-uniform(0, 0.2), -uniform(0, 0.1), 0};
    if (random() % 2 == 0) head.response = {Response::Curve::kGamma, uniform(1.5, 2.4), {}};
  }
  return rig;
}

}  // namespace nodal::test
