// The two reference rigs that every figure of speed is made on, and what they film.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/calibration.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/table_compiler.h"

namespace nodal::bench {

struct Workload {
  std::string name;
  Calibration rig;
  table::RaymapSpec raymap;
};

/// Ten heads 720x480 of 100 degrees with a barrel of -0.1 (four up, four down, two at the poles) into 2048x1024 I420.
Workload r10();
/// Eight fisheyes 1920x1080 (six upright, two at the poles) into 3840x1920 I420.
Workload r8();
/// `heads` alike, spread evenly over the sphere, of which `heads_a_ray` see a ray in the mean, into width x width / 2
/// I420. Their lenses keep areas (2 f sin(a / 2)), and at their axes pixels are as fine as the raymap's at its equator:
/// of how many heads they are, neither the heads' pixels altogether nor their overlap depend.
Workload spread(int heads, double heads_a_ray, int width);

/// width * height points of Hammersley's, evenly over the sphere: ray k of a row after the other is at the height
/// y = (2 k + 1) / n - 1, turned by k's bits the other way round.
class Hammersley final : public geometry::RaymapLayout {
 public:
  Hammersley(int width, int height) : RaymapLayout(width, height) {}
  std::string_view name() const override { return "hammersley"; }
  bool scattered() const override { return true; }
  std::optional<geometry::Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  /// Nothing here looks for rays.
  std::optional<geometry::Pixel> pixel(const geometry::Ray&) const override { return std::nullopt; }
};

/// The pictures of all heads for one trigger, packed, with memory of their own.
struct FilmedSet {
  std::vector<std::vector<std::uint8_t>> memory;
  std::vector<ImageView> heads;
};

/// The rig in a scene of waves of every fineness down to two pixels, and a little noise. Every head sees the same
/// scene, as light falls into it and its gain makes it; what they see is full range, no head is clipped.
FilmedSet film(const Calibration& rig, PixelFormat format, std::uint32_t seed);
/// The same in other memory.
FilmedSet copy(const FilmedSet& set);

}  // namespace nodal::bench
