// The blend table: for every raymap sample, which source samples to take and how much of each. Made by
// stitch/table from a calibration and a layout, proven there, and only then run. Integers only.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/units.h"

namespace nodal::blend {

/// Of a source coordinate. Twelve bits put a sample within 1/8192 px of where it belongs, so that even black
/// next to white, on both axes, is off by less than a tenth of a level.
inline constexpr int kFractionBits = 12;
inline constexpr int kWeightBits = 15;    ///< weights of a covered sample sum to exactly 1 << kWeightBits
inline constexpr int kGainBits = 12;      ///< a gain of 1 is 1 << kGainBits
inline constexpr int kSharpenBits = 6;    ///< Source::sharpen is in 1 / (1 << kSharpenBits)
inline constexpr int kMaxSharpen = 16;
inline constexpr int kMaxGain = 32767;    ///< just below 8; with it every sum below fits 63 bits

/// One head's share in one raymap sample: four source samples from (x, y) on, mixed by the fractions.
struct Tap {
  std::uint16_t x = 0;           ///< left column of the 2x2 samples, in the component's own grid
  std::uint16_t y = 0;           ///< upper row
  std::uint16_t fraction_x = 0;  ///< of the right column, 0 .. (1 << kFractionBits) - 1
  std::uint16_t fraction_y = 0;  ///< of the lower row
  std::uint16_t weight = 0;      ///< 1 .. 1 << kWeightBits
  std::uint16_t gain = 0;        ///< undoes the vignetting here, 1 .. kMaxGain; Source::gain undoes the rest
  HeadIndex head = 0;
  std::uint8_t reserved = 0;     ///< 0
  friend bool operator==(const Tap&, const Tap&) = default;
};
static_assert(sizeof(Tap) == 14);

/// The taps of one sample grid of the raymap. Sample (x, y) has taps[first[y * width + x]] up to
/// taps[first[y * width + x + 1]]; a sample with none is not covered.
struct GridTable {
  int width = 0;
  int height = 0;
  int row_step = 1;                  ///< raymap rows to a row of this grid: 1, or 2 for I420 chroma
  std::vector<std::uint32_t> first;  ///< width * height + 1 of them, from 0, not falling
  std::vector<Tap> taps;
};

/// What a component is made of, so that gains act on light and uncovered samples are black.
struct ComponentRule {
  std::uint8_t grid = 0;      ///< index into BlendTable::grids
  std::uint8_t black = 0;     ///< the value that means no light: 0 for R G B Y (full range), 128 for U V
  std::uint8_t gain_row = 0;  ///< which of Source::gain acts: 0 red, 1 green, 2 blue
};

/// A raymap's blend, whole. Immutable once validated.
struct BlendTable {
  PixelFormat format = PixelFormat::kI420;  ///< of the raymap
  int width = 0;                            ///< of the raymap, px
  int height = 0;
  struct Source {
    PixelFormat format = PixelFormat::kI420;
    int width = 0;
    int height = 0;
    /// Undoes the head's own gain, by gain_row, 1 .. kMaxGain. Acts as tap gain * this, rounded to kGainBits.
    std::array<std::uint16_t, 3> gain{1 << kGainBits, 1 << kGainBits, 1 << kGainBits};
    /// How much of a sample's difference from each of its four neighbours is added to it before it is mixed, 0 ..
    /// kMaxSharpen: gives back what mixing four samples takes from fine detail. 0 leaves samples as they are.
    std::uint8_t sharpen = 0;
  };
  std::vector<Source> sources;         ///< what each head must deliver, by head index
  std::vector<GridTable> grids;        ///< full resolution first, then chroma where it has its own
  std::array<ComponentRule, kMaxPlanes> components{};
};

}  // namespace nodal::blend
