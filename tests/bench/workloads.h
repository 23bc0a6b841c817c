// The two reference rigs that every figure of speed is made on, and what they film.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/calibration.h"
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

/// The pictures of all heads for one trigger, packed, with memory of their own.
struct FrameSet {
  std::vector<std::vector<std::uint8_t>> memory;
  std::vector<ImageView> heads;
};

/// The rig in a scene of waves of every fineness down to two pixels, and a little noise. Every head sees the same
/// scene, as light falls into it and its gain makes it; what they see is full range, no head is clipped.
FrameSet film(const Calibration& rig, PixelFormat format, std::uint32_t seed);
/// The same in other memory.
FrameSet copy(const FrameSet& set);

}  // namespace nodal::bench
