// Photographs of a flat scene by a synthetic head: an independent renderer. It shares no code with what it tests; its
// lenses are formulas written here, its rays are traced at 5 x 5 points of each pixel.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

namespace nodal::photographer {

/// A head's lens, pixel corners at integers. With p = (u - cx, (v - cy) / aspect), r = |p|:
///   kTsai           tan(angle) = r (1 + k[0] r^2 + k[1] r^4) / f
///   kKannalaBrandt  r = f (angle + k[0] angle^3 + k[1] angle^5 + ...)
struct Lens {
  enum class Kind { kTsai, kKannalaBrandt } kind = Kind::kTsai;
  int width = 720, height = 480;
  double f = 490, cx = 360.8, cy = 224.6, aspect = 1;
  std::array<double, 4> k{};
  /// The unit ray of a point; all zeros where the lens sees nothing.
  std::array<double, 3> ray(double u, double v) const;
};

/// One photograph: the scene's pose, its light, and the sensor's effects.
struct Shot {
  double tilt_deg = 0;                            ///< tilt of the scene's normal against the axis
  double tilt_about_deg = 0;                      ///< direction of the tilt
  double spin_deg = 0;                            ///< rotation about the axis
  double x = 0, y = 0;                            ///< where the axis meets the scene, in scene widths from its centre
  double distance = 0.5;                          ///< along the axis, scene widths
  double blur_px = 0.7;                           ///< sigma
  double noise = 2.0;                             ///< sigma, grey levels of 255
  double exposure = 0.9;                          ///< light at the brightest point, 1 saturates
  double light_x = 0, light_y = 0, light_xx = 0;  ///< light over the scene: 1 + light_x X + light_y Y + light_xx X^2
  std::array<double, 3> vignetting{};             ///< 1 + v1 s + v2 s^2 + v3 s^3, s = (r / half diagonal)^2
  double gamma = 2.2;                             ///< encoded = light^(1/gamma)
  double background = 0.2;                        ///< light outside the scene
  std::uint64_t seed = 1;
};

/// Reflectance (0..1, linear light) at a point of the scene, in scene widths from its centre, y down; negative:
/// outside.
using Scene = std::function<double(double X, double Y)>;

struct Photo {
  int width = 0, height = 0;
  std::vector<std::uint8_t> grey;
};
Photo take(const Scene& scene, const Lens& lens, const Shot& shot);

/// A raster whose pixels are squares of sRGB-encoded grey, as printed.
Scene print_of(int width, int height, const std::vector<std::uint8_t>& grey);
/// A chessboard of columns x rows squares over the whole width, with a white margin of one square.
Scene chessboard(int columns, int rows);

}  // namespace nodal::photographer
