// The two reference rigs of all speed measurements, and their pictures.
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

/// Ten 720x480 heads of 100 degrees with a barrel of -0.1 (four up, four down, two at the poles), 2048x1024 I420.
Workload r10();
/// Eight fisheyes 1920x1080 (six upright, two at the poles) into 3840x1920 I420.
Workload r8();
/// `heads` equal heads, evenly spread over the sphere, of which on average `heads_a_ray` see a ray; width x width / 2
/// I420. Their lenses are equal-area (2 f sin(a / 2)), and at their axes pixels are as fine as the raymap's at its
/// equator: neither their total pixels nor their overlap depend on the number of heads.
Workload spread(int heads, double heads_a_ray, int width);

/// The pictures of all heads for one trigger, packed, in their own memory.
struct FilmedSet {
  std::vector<std::vector<std::uint8_t>> memory;
  std::vector<ImageView> heads;
};

/// Pictures of a scene with waves of all frequencies down to two pixels, and a little noise. Every head sees the same
/// scene under its fall-off and gain; values are full range, no head clips.
FilmedSet film(const Calibration& rig, PixelFormat format, std::uint32_t seed);
/// A copy in other memory.
FilmedSet copy(const FilmedSet& set);

}  // namespace nodal::bench
