// Measures how fast another clock runs, from the times at which its periods begin.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// The rate of pulses or exposures relative to a nominal rate, over the last kBlocks * kBlockPeriods periods: the mean
/// distance from the nominal grid in the newer half, compared with that in the older half. At 30 per second, a jitter
/// of +-0.2 ms causes an error of about 1 ppm.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class DriftMeter {
 public:
  void restart(FrameRate rate);
  /// Period `number` began, or was exposed, `at`. Numbers increase; a gap means that periods were missed. If the
  /// distance from the grid changes by more than half a period from one call to the next, the measurement starts again.
  void add(std::int64_t number, Instant at);
  /// In 1/1000 ppm; positive: slower than nominal. Nothing before two blocks are full.
  std::optional<std::int32_t> ppb() const;

  static constexpr std::size_t kBlocks = 16;
  static constexpr std::int64_t kBlockPeriods = 32;

 private:
  struct Block {
    std::int64_t moments = 0;
    std::int64_t numbers = 0;    ///< sum of the numbers, relative to the first
    std::int64_t distances = 0;  ///< sum of the distances from the nominal grid, ns
  };
  struct Mean {
    std::int64_t number = 0, distance = 0;
  };
  Mean mean(std::size_t from, std::size_t count) const;
  const Block& block(std::size_t age) const { return blocks_[(full_ - 1 - age) % kBlocks]; }

  FrameRate rate_;
  bool started_ = false;
  std::int64_t first_number_ = 0;
  Instant first_at_;
  std::int64_t last_distance_ = 0;
  Block filling_;
  std::int64_t filling_since_ = 0;  ///< a number, relative to the first
  std::array<Block, kBlocks> blocks_{};
  std::size_t full_ = 0;  ///< number of blocks filled so far
};

}  // namespace nodal::firmware
