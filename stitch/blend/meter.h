// Light metering over the sphere: what the heads of a frame set saw, by the solid angle it covers. Integers only.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/stops.h"
#include "protocol/base/units.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::blend {

/// Where every head sees the middle of every cell of a coarse grid on the sphere. Made by stitch/table.
struct MeterTable {
  struct Sample {
    std::uint16_t x = 0;  ///< of the head's picture, full resolution; (x + 1, y + 1) is inside too
    std::uint16_t y = 0;
    std::int16_t lost = 0;  ///< what vignetting and the head's own gain do to light there, stops
    HeadIndex head = 0;
  };
  struct Cell {
    std::uint32_t solid_angle = 0;  ///< of all cells' sum, the whole sphere, this many 1 / 2^24
    std::uint32_t end = 0;          ///< its samples are those up to here, from the cell's before
  };
  struct Head {
    std::uint16_t width = 0;
    std::uint16_t height = 0;
    std::array<std::int16_t, 256> stops{};  ///< of light, by level; full is 0. Level 0 is taken for a half
    std::uint32_t overlaps = 0;             ///< bit i: head i sees cells that it sees
  };
  std::vector<Head> heads;
  std::vector<Cell> cells;
  std::vector<Sample> samples;
};

inline constexpr int kClippedLevel = 250;  ///< from here on a sample may have been brighter than it says
inline constexpr int kBlackLevel = 5;      ///< up to here it may have been darker

/// What one head saw, and under which settings.
struct HeadLight {
  Stops exposure = 0;             ///< in effect: stops_of(shutter) + stops_of(gain)
  Stops light = 0;                ///< mean of what it looks at, so that light + exposure is 0 at a full sample
  std::uint32_t solid_angle = 0;  ///< of what it looks at, in 1 / 2^24 spheres; 0: it has no picture
  std::uint32_t clipped = 0;      ///< of that, as it saw it itself
  std::uint32_t black = 0;
  std::uint32_t overlaps = 0;  ///< bit i: head i sees some of it too
};

struct SphereLight {
  std::uint64_t set = 0;
  std::array<HeadLight, kMaxHeads> heads{};
  Stops light = 0;                ///< mean over every cell that a head of the set sees
  std::uint32_t solid_angle = 0;  ///< of these
};

/// A cell's light is the mean of the heads that saw it neither clipped nor black, whatever the others say. Clipped by
/// all it is the most that one of them still could tell, and black to all the least: so what is told never lies
/// beyond what is there, and an exposure that follows it never goes too far.
///
/// Threading: thread-safe. Ownership: none. Allocates nothing. Errors: none; a head that is missing, or is not as the
/// table says, has planes[0].data == nullptr or another size and is left out.
SphereLight meter(const MeterTable& table, std::span<const ImageView> heads, std::span<const ExposedHead> settings);

}  // namespace nodal::blend
