#pragma once

#include <atomic>
#include <cstdint>

#include "firmware/frame/outlet.h"
#include "firmware/frame/raymap.h"
#include "firmware/frame/statistics.h"
#include "firmware/picture/jpeg.h"
#include "hal/clock.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

/// The stage between the blend and the readers of raymaps: encodes a JPEG if a client pulls JPEGs, and gives every
/// outlet a loan of the raymap. It waits for the publisher only, and the publisher waits for no client: every raymap is
/// published.
///
/// Threading: step() is thread-bound to the encoder; set_wanted(), set_every() and the figures are for any thread; an
///   outlet's other end is its reader's thread.
/// Ownership: its pool lends the JPEGs. Pixels that no client pulls are released at once, so that fewer pixel buffers,
///   the largest objects in the board's memory, are in use.
/// Errors: a raymap whose encoding fails is offered without a JPEG and is counted.
class EncodeStage {
 public:
  EncodeStage(const RaymapConfig& config, hal::ClockPort& clock, SpscRing<Raymap>& raymaps_in);

  /// True when it did something.
  bool step();
  /// Whether any client pulls JPEGs, and whether any pulls pixels.
  void set_wanted(bool jpeg, bool pixels) {
    wanted_.store(jpeg, std::memory_order_relaxed);
    pixels_wanted_.store(pixels, std::memory_order_relaxed);
  }
  /// Whether a take records JPEGs. Any thread.
  void set_recording(bool jpeg) { recording_.store(jpeg, std::memory_order_relaxed); }
  /// Only each `every`-th raymap is encoded; the others are marked as shed.
  void set_every(std::uint32_t every) { every_.store(every, std::memory_order_relaxed); }

  /// The outlet that the publisher reads.
  Outlet<Raymap>& published() { return published_; }
  /// Registers a further reader, before the first step().
  Outlet<Raymap>& add_outlet(const OutletSpec& spec, bool open = true) { return outlets_.add(spec, open); }
  const RecentTimes& times() const { return times_; }
  std::uint64_t failed() const { return failed_.load(std::memory_order_relaxed); }
  std::uint64_t steps() const { return passed_.load(std::memory_order_relaxed); }

  static constexpr std::size_t kMaxBuffers = 64;
  static constexpr OutletSpec kPublished{"publish", OutletPolicy::kLossless, 2, 1};

 private:
  const RaymapConfig config_;
  hal::ClockPort& clock_;
  SpscRing<Raymap>& raymaps_in_;
  LoanPool<std::vector<std::uint8_t>> jpegs_;
  Outlets<Raymap> outlets_;
  Outlet<Raymap>& published_;
  JpegEncoder jpeg_;
  std::atomic<bool> wanted_{false};
  std::atomic<bool> pixels_wanted_{true};
  std::atomic<bool> recording_{false};
  std::atomic<std::uint32_t> every_{1};
  std::atomic<std::uint64_t> failed_{0};
  std::atomic<std::uint64_t> passed_{0};
  RecentTimes times_;
};

}  // namespace nodal::firmware
