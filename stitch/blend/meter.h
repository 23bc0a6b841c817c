// Light metering over the sphere: the light in each head of a frame set, weighted by solid angle. Integers only.
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
    std::int16_t lost = 0;  ///< effect of vignetting and the head's own gain on light there, stops
    HeadIndex head = 0;
  };
  struct Cell {
    std::uint32_t solid_angle = 0;  ///< of all cells' sum, the whole sphere, this many 1 / 2^24
    std::uint32_t end = 0;          ///< its samples are those up to here, from the cell's before
  };
  struct Head {
    std::uint16_t width = 0;
    std::uint16_t height = 0;
    std::array<std::int16_t, 256> stops{};  ///< of light, by level; full is 0. Level 0 counts as 0.5
    std::uint32_t overlaps = 0;             ///< bit i: head i sees cells that it sees
  };
  std::vector<Head> heads;
  std::vector<Cell> cells;
  std::vector<Sample> samples;
};

inline constexpr int kClippedLevel = 250;  ///< from this level on a sample may be clipped
inline constexpr int kBlackLevel = 5;      ///< up to this level it may be crushed to black

/// The light in one head, and its settings.
struct HeadLight {
  Stops exposure = 0;             ///< in effect: stops_of(shutter) + stops_of(gain)
  Stops light = 0;                ///< mean light of its cells, so that light + exposure is 0 at a full sample
  std::uint32_t solid_angle = 0;  ///< solid angle of its cells, in 1 / 2^24 spheres; 0: it has no picture
  std::uint32_t clipped = 0;      ///< the clipped part of that, in its own picture
  std::uint32_t black = 0;
  std::uint32_t overlaps = 0;  ///< bit i: head i sees some of it too
};

struct SphereLight {
  std::uint64_t set = 0;
  std::array<HeadLight, kMaxHeads> heads{};
  Stops light = 0;                ///< mean over every cell that a head of the set sees
  std::uint32_t solid_angle = 0;  ///< of these
};

/// A cell's light is the mean over the heads in which it is neither clipped nor black. If all are clipped it is the
/// largest light that one of them can measure, if all are black the smallest: so the error is always towards the middle,
/// and an exposure that follows the measurement never overshoots.
///
/// Threading: thread-safe. Ownership: none. Allocates nothing. Errors: none; a head that is missing, or is not as the
/// table says, has planes[0].data == nullptr or another size and is left out.
SphereLight meter(const MeterTable& table, std::span<const ImageView> heads, std::span<const ExposedHead> settings);

}  // namespace nodal::blend
