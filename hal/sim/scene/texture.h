// Patterns for the procedural scene. Each takes the width of a sample on the surface and filters out finer detail, so
// that the picture has neither flicker nor aliasing.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "hal/sim/scene/scene.h"

namespace nodal::hal::sim {

inline Light operator*(const Light& a, float k) { return {a.r * k, a.g * k, a.b * k}; }
inline Light operator+(const Light& a, const Light& b) { return {a.r + b.r, a.g + b.g, a.b + b.b}; }
inline Light mix(const Light& a, const Light& b, double k) {
  const auto f = static_cast<float>(k);
  return {a.r + (b.r - a.r) * f, a.g + (b.g - a.g) * f, a.b + (b.b - a.b) * f};
}

/// A hash of three integers as a number in 0..1.
inline double cell_value(std::int64_t x, std::int64_t y, std::int64_t z, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x8DA6B343U ^ static_cast<std::uint32_t>(y) * 0xD8163841U ^
                    static_cast<std::uint32_t>(z) * 0xCB1AB31FU ^ seed * 0x9E3779B9U;
  h = (h ^ (h >> 15)) * 0x2C1B3C6DU;
  h = (h ^ (h >> 12)) * 0x297A2D39U;
  return (h ^ (h >> 15)) * 0x1p-32;
}

/// The share of [x - w/2, x + w/2] that is in the first `duty` of a unit period: a box-filtered pulse train.
inline double pulse_train(double x, double duty, double w) {
  const auto integral = [duty](double at) {
    const double whole = std::floor(at);
    return whole * duty + std::min(at - whole, duty);
  };
  w = std::max(w, 1e-6);
  return (integral(x + w / 2) - integral(x - w / 2)) / w;
}

/// A checkerboard of unit squares, 0 or 1, box-filtered.
inline double checker(double x, double y, double wx, double wy) {
  const double a = 2 * pulse_train(x / 2, 0.5, wx / 2) - 1;
  const double b = 2 * pulse_train(y / 2, 0.5, wy / 2) - 1;
  return 0.5 - 0.5 * a * b;
}

/// Smooth random values on the unit lattice, 0..1.
inline double value_noise(double x, double y, double z, std::uint32_t seed) {
  const double fx = std::floor(x);
  const double fy = std::floor(y);
  const double fz = std::floor(z);
  const auto ix = static_cast<std::int64_t>(fx);
  const auto iy = static_cast<std::int64_t>(fy);
  const auto iz = static_cast<std::int64_t>(fz);
  const auto ease = [](double t) { return t * t * (3 - 2 * t); };
  const double u = ease(x - fx);
  const double v = ease(y - fy);
  const double w = ease(z - fz);
  double corner[2][2];
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 2; ++j) {
      const double a = cell_value(ix, iy + j, iz + k, seed);
      const double b = cell_value(ix + 1, iy + j, iz + k, seed);
      corner[k][j] = a + (b - a) * u;
    }
  }
  const double near = corner[0][0] + (corner[0][1] - corner[0][0]) * v;
  const double far = corner[1][0] + (corner[1][1] - corner[1][0]) * v;
  return near + (far - near) * w;
}

/// A sum of octaves of value_noise down to the sample's width, at most `octaves`; mean 0, about -1..1.
inline double fractal(double x, double y, double z, double width, int octaves, std::uint32_t seed) {
  double sum = 0;
  double amplitude = 1;
  for (int o = 0; o < octaves; ++o, amplitude *= 0.55) {
    const double keep = std::clamp(2.0 - 4.0 * width, 0.0, 1.0);  // 0 when a sample is half a cell wide
    if (keep <= 0) break;
    sum += keep * amplitude * (value_noise(x, y, z, seed + static_cast<std::uint32_t>(o)) - 0.5);
    x = 2 * x + 17.3;
    y = 2 * y + 5.7;
    z = 2 * z - 9.1;
    width *= 2;
  }
  return sum;
}

}  // namespace nodal::hal::sim
