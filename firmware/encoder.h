#pragma once

#include <atomic>
#include <cstdint>

#include "firmware/jpeg.h"
#include "firmware/raymap.h"
#include "firmware/statistics.h"
#include "hal/clock.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

/// Between blend and publish: makes a JPEG of a raymap when a client wants one, and passes it on.
///
/// Threading: step() is thread-bound to the encoder; set_wanted(), set_every() and the figures are for any thread.
/// Ownership: raymaps pass through; JPEG buffers come from jpegs_free(). Pixels that nobody pulls go back to the blend
///   at once: a raymap is the largest thing a board holds, and so it holds fewer.
/// Errors: a raymap that could not be encoded goes on without its JPEG and is counted.
class EncodeStage {
 public:
  EncodeStage(const RaymapConfig& config, hal::ClockPort& clock, SpscRing<Raymap>& raymaps_in,
              SpscRing<Buffer>& pixels_unread);

  /// True when it did something.
  bool step();
  /// Whether any client pulls JPEGs, and whether any pulls pixels.
  void set_wanted(bool jpeg, bool pixels) {
    wanted_.store(jpeg, std::memory_order_relaxed);
    pixels_wanted_.store(pixels, std::memory_order_relaxed);
  }
  /// Of so many raymaps one is encoded; the others go on as shed.
  void set_every(std::uint32_t every) { every_.store(every, std::memory_order_relaxed); }

  SpscRing<Raymap>& raymaps_out() { return raymaps_out_; }
  SpscRing<Buffer>& jpegs_free() { return jpegs_free_; }
  const RecentTimes& times() const { return times_; }
  std::uint64_t failed() const { return failed_.load(std::memory_order_relaxed); }
  std::uint64_t steps() const { return passed_.load(std::memory_order_relaxed); }

  static constexpr std::size_t kMaxBuffers = 24;
  static constexpr std::size_t kRaymapsWaiting = 2;

 private:
  Buffer take_buffer();

  const RaymapConfig config_;
  hal::ClockPort& clock_;
  SpscRing<Raymap>& raymaps_in_;
  SpscRing<Buffer>& pixels_unread_;
  SpscRing<Raymap> raymaps_out_;
  SpscRing<Buffer> jpegs_free_;
  JpegEncoder jpeg_;
  std::size_t buffers_made_ = 0;
  std::atomic<bool> wanted_{false};
  std::atomic<bool> pixels_wanted_{true};
  std::atomic<std::uint32_t> every_{1};
  std::atomic<std::uint64_t> failed_{0};
  std::atomic<std::uint64_t> passed_{0};
  RecentTimes times_;
};

}  // namespace nodal::firmware
