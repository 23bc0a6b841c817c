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

/// For every cell of a coarse grid on the sphere, where the heads see its centre. Made by stitch/table.
struct MeterTable {
  struct Sample {
    std::uint16_t x = 0;  ///< column in the head's full-size picture; (x + 1, y + 1) is inside, too
    std::uint16_t y = 0;
    std::int16_t lost = 0;  ///< effect of vignetting and the head's own gain on light there, stops
    HeadIndex head = 0;
  };
  struct Cell {
    std::uint32_t solid_angle = 0;  ///< unit: 2^-24 of the sphere
    std::uint32_t end = 0;          ///< its samples are samples[previous cell's end .. end)
  };
  struct Head {
    std::uint16_t width = 0;
    std::uint16_t height = 0;
    std::array<std::int16_t, 256> stops{};  ///< light in stops, by level; a full sample is 0. Level 0 counts as 0.5
    std::uint32_t overlaps = 0;             ///< bit i: head i sees some of the same cells
  };
  std::vector<Head> heads;
  std::vector<Cell> cells;
  std::vector<Sample> samples;
};

inline constexpr int kClippedLevel = 250;  ///< from this level on a sample may be clipped
inline constexpr int kBlackLevel = 5;      ///< up to this level it may be crushed to black

/// The light that one head measured, and its settings.
struct HeadLight {
  Stops exposure = 0;             ///< stops_of(shutter) + stops_of(gain) that were in effect
  Stops light = 0;                ///< mean light of its cells, so that light + exposure is 0 at a full sample
  std::uint32_t solid_angle = 0;  ///< solid angle of its cells, in 1 / 2^24 spheres; 0: no picture
  std::uint32_t clipped = 0;      ///< the part of it that is clipped in the head's own picture
  std::uint32_t black = 0;
  std::uint32_t overlaps = 0;  ///< bit i: head i sees some of the same cells
};

struct SphereLight {
  std::uint64_t set = 0;
  std::array<HeadLight, kMaxHeads> heads{};
  Stops light = 0;                ///< mean over every cell that a head of the set sees
  std::uint32_t solid_angle = 0;  ///< solid angle of those cells, in 2^-24 spheres
};

/// A cell's light is the mean over the heads in which it is neither clipped nor black. If all are clipped, it is the
/// largest lower bound that one of them gives; if all are black, the smallest upper bound. So the estimate errs towards
/// mid-range, and an exposure that follows it never overshoots.
///
/// Threading: thread-safe. Ownership: none. Allocates nothing. Errors: none; a missing head (planes[0].data == nullptr)
/// and a head whose size differs from the table's are left out.
SphereLight meter(const MeterTable& table, std::span<const ImageView> heads, std::span<const ExposedHead> settings);

}  // namespace nodal::blend
