// How fast somebody else's clock runs, from when it says its periods begin.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// The rate of pulses or exposures against a nominal one, over the last kBlocks * kBlockPeriods periods: the older
/// half's mean distance from the nominal grid against the newer half's. At 30 a second, +-0.2 ms of jitter on every
/// moment are worth about 1 ppm.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class DriftMeter {
 public:
  void restart(FrameRate rate);
  /// Period `number` began, or was exposed, `at`; numbers rise, with gaps where some were missing. A moment that is
  /// half a period from where the last one was is no drift: the meter starts anew.
  void add(std::int64_t number, Instant at);
  /// Positive is slow, in 1/1000 ppm; nothing before two blocks are full.
  std::optional<std::int32_t> ppb() const;

  static constexpr std::size_t kBlocks = 16;
  static constexpr std::int64_t kBlockPeriods = 32;

 private:
  struct Block {
    std::int64_t moments = 0;
    std::int64_t numbers = 0;    ///< their sum, counted from the first
    std::int64_t distances = 0;  ///< from the nominal grid, ns, their sum
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
  std::int64_t filling_since_ = 0;  ///< number, counted from the first
  std::array<Block, kBlocks> blocks_{};
  std::size_t full_ = 0;  ///< blocks, ever
};

}  // namespace nodal::firmware
