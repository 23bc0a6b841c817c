// The stage that blends frame sets into raymaps. Any number of threads may call it.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/frame/outlet.h"
#include "firmware/frame/raymap.h"
#include "firmware/frame/statistics.h"
#include "firmware/picture/band_tickets.h"
#include "firmware/picture/calibration_swap.h"
#include "firmware/picture/moving_seams.h"
#include "firmware/picture/raymap_buffers.h"
#include "hal/clock.h"
#include "protocol/base/image.h"
#include "protocol/base/spsc_ring.h"
#include "stitch/sets/set_blend.h"

namespace nodal::decode {
enum class DecodeFault : std::uint8_t;
}

namespace nodal::firmware {

/// Every call of step() does one piece of work of a round of sets::SetBlend. The heads' small views are made once a
/// period (sets::kSeamPeriod) and only with placed seams, for the seam stage. Between two raymaps, one thread finishes
/// the raymap, adopts a new calibration and takes the next set. So a swap of calibrations always falls between two
/// sets, and every raymap names the one calibration that it was made with. A calibration with one table per field makes
/// two raymaps of each set, one after the other; the fields are read in place from the frames. No thread waits for
/// another: step() returns false if there is no work for it.
///
/// Threading: step() is thread-safe; the outlet's and the rings' other ends are capture's, the encoder's, the keeper's
///   and control's, one thread each; the counts may be read by any.
/// Ownership: holds a loan of the set being blended; its pool lends the pixels of raymaps.
/// Errors: none; sets that make no raymap are counted.
class Blender {
 public:
  Blender(const RaymapConfig& config, hal::ClockPort& clock, Outlet<SetLoan>& sets_in);

  /// True when it did something.
  bool step();
  /// Ends: gives every set back. No thread may be in step() any more.
  void close();

  Outlet<SetLoan>& sets_in() { return sets_in_; }
  CalibrationSwap& swap() { return swap_; }
  MovingSeams& seams() { return seams_; }
  const MovingSeams& seams() const { return seams_; }
  SpscRing<Raymap>& raymaps_out() { return raymaps_out_; }
  /// The metered light of each blended set. When the ring is full, new entries are discarded.
  SpscRing<blend::SphereLight>& light_out() { return light_out_; }
  /// Every set with a lower number was begun, skipped or missed; swap() has named its calibration, and seams() its
  /// seams.
  std::uint64_t sets_begun() const { return seams_.log().sets_begun(); }

  /// Only each `every`-th set is blended. Any thread.
  void set_every(std::uint32_t every) { every_.store(every, std::memory_order_relaxed); }

  /// Frames of one head that could not be decoded; in those sets the head counts as missing.
  struct Undecodable {
    std::atomic<std::uint64_t> frames{0};
    std::atomic<decode::DecodeFault> now{};  ///< the newest frame's fault
  };
  struct Counts {
    std::atomic<std::uint64_t> blended{0};              ///< raymaps
    std::atomic<std::uint64_t> without_calibration{0};  ///< sets
    std::atomic<std::uint64_t> shed{0};                 ///< sets: the board is overloaded
    std::atomic<std::uint64_t> without_buffer{0};       ///< sets: clients still held every buffer
    std::atomic<std::uint64_t> unfit_frames{0};         ///< frames whose size or format the calibration is not for
    std::atomic<std::uint64_t> adopted{0};              ///< calibrations put in force
    std::array<Undecodable, kMaxHeads> undecodable;

    /// Rises whenever a set is released.
    std::uint64_t finished() const {
      return blended.load() + without_calibration.load() + shed.load() + without_buffer.load();
    }
  };
  const Counts& counts() const { return counts_; }
  const Undecodable& undecodable(std::size_t head) const { return counts_.undecodable[head]; }
  const RecentTimes& times() const { return times_; }
  /// Rises with every piece of work. If it does not rise while !idle(), the stage hangs.
  std::uint64_t progress() const { return progress_.load(std::memory_order_relaxed); }
  /// No set is queued or being blended.
  bool idle() const { return idle_.load(std::memory_order_acquire); }

  /// The queue holds all sets that capture may offer at once. When a head stops delivering, the set that waited for it
  /// is closed together with those behind it, which are complete without it: three, by Capture::kHalfPeriodsToWait.
  static constexpr OutletSpec kSets{"blend", OutletPolicy::kLossless, 3, 1};
  static constexpr std::size_t kMaxBuffers = 64;
  static constexpr std::size_t kRaymapsWaiting = 2;

 private:
  bool run_band();
  bool coordinate();
  bool adopt();
  bool begin();
  void begin_blend();
  bool next_round();
  void count_undecodable();
  void begin_raymap();
  void measure();
  bool finish();

  hal::ClockPort& clock_;
  Outlet<SetLoan>& sets_in_;
  SpscRing<Raymap> raymaps_out_;
  SpscRing<blend::SphereLight> light_out_;

  // Written between two rounds of bands, only by the thread that holds coordinating_.
  std::atomic_flag coordinating_;
  sets::SetBlend blend_;
  CalibrationSwap swap_;
  MovingSeams seams_;
  RaymapBuffers buffers_;
  SetLoan set_;            ///< the set being blended
  std::size_t field_ = 0;  ///< index of the field being blended, and of its table
  Instant begun_;          ///< when the work on the raymap began
  Raymap raymap_;          ///< has pixels once it is begun
  BandTickets bands_;

  std::atomic<std::uint32_t> every_{1};
  Counts counts_;
  RecentTimes times_;
  std::atomic<bool> idle_{true};
  std::atomic<std::uint64_t> progress_{0};
};

}  // namespace nodal::firmware
