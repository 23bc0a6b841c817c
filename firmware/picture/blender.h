// The stage that blends frame sets into raymaps. Any number of threads may call it.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/frame/outlet.h"
#include "firmware/frame/raymap.h"
#include "firmware/frame/snapshot.h"
#include "firmware/frame/statistics.h"
#include "firmware/picture/seam_stage.h"
#include "hal/clock.h"
#include "protocol/base/image.h"
#include "protocol/base/spsc_ring.h"
#include "stitch/sets/blend_plan.h"
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
  SpscRing<sets::BlendSetup>& tables_in() { return tables_in_; }
  /// Calibrations and seams (these without memory) that are no longer in force; the keeper frees them outside the frame
  /// path.
  SpscRing<sets::BlendSetup>& tables_out() { return tables_out_; }
  SpscRing<Raymap>& raymaps_out() { return raymaps_out_; }
  /// Placed seams: the seam stage's work, and what it made of it. One request is under way at most.
  SpscRing<SeamRequest>& seams_out() { return seams_out_; }
  SpscRing<SeamAnswer>& seams_in() { return seams_in_; }
  /// Which seams sets are blended with, for takes; nothing before log_seams(). Seams stay where they are while it is
  /// full.
  SpscRing<SeamChange>& seam_changes_out() { return seam_changes_out_; }
  /// Call before the first step.
  void log_seams() { logs_seams_ = true; }
  /// The reason of the newest refusal of placed seams. For control.
  Snapshot<std::string>& seams_refused() { return seams_refused_; }
  /// The metered light of each blended set. When the ring is full, new entries are discarded.
  SpscRing<blend::SphereLight>& light_out() { return light_out_; }
  /// The first set that a calibration is in force for.
  struct Adoption {
    std::uint64_t first_set = 0;
    Sha256 calibration{};
  };
  SpscRing<Adoption>& adoptions_out() { return adoptions_out_; }
  /// The newest of them, for control.
  Snapshot<Adoption>& adoption() { return adoption_; }
  /// Every set with a lower number was begun, skipped or missed; adoptions_out() has named its calibration, and
  /// seam_changes_out() its seams.
  std::uint64_t sets_begun() const { return sets_begun_.load(std::memory_order_acquire); }

  /// Only each `every`-th set is blended. Any thread.
  void set_every(std::uint32_t every) { every_.store(every, std::memory_order_relaxed); }

  struct Counts {
    std::atomic<std::uint64_t> blended{0};              ///< raymaps
    std::atomic<std::uint64_t> without_calibration{0};  ///< sets
    std::atomic<std::uint64_t> shed{0};                 ///< sets: the board is overloaded
    std::atomic<std::uint64_t> without_buffer{0};       ///< sets: clients still held every buffer
    std::atomic<std::uint64_t> unfit_frames{0};         ///< frames whose size or format the calibration is not for
    std::atomic<std::uint64_t> adopted{0};              ///< calibrations put in force
    std::atomic<std::uint64_t> seams_moved{0};          ///< tables with other seams put in force
    std::atomic<std::uint64_t> seams_late{0};           ///< periods without placing: the one before was not done
    std::atomic<std::uint64_t> seams_refused{0};        ///< tables with other seams that were not proven

    /// Rises whenever a set is released.
    std::uint64_t finished() const {
      return blended.load() + without_calibration.load() + shed.load() + without_buffer.load();
    }
  };
  const Counts& counts() const { return counts_; }
  /// Frames of one head that could not be decoded; in those sets the head counts as missing.
  struct Undecodable {
    std::atomic<std::uint64_t> frames{0};
    std::atomic<decode::DecodeFault> now{};  ///< of the newest frame
  };
  const Undecodable& undecodable(std::size_t head) const { return undecodable_[head]; }
  const RecentTimes& times() const { return times_; }
  /// Rises with every piece of work. If it does not rise while !idle(), the stage hangs.
  std::uint64_t progress() const { return progress_.load(std::memory_order_relaxed); }
  /// No set is queued or being blended.
  bool idle() const { return idle_.load(std::memory_order_acquire); }

  /// The queue holds all sets that capture may offer at once. When a head stops delivering, the set that waited for it
  /// is closed together with those behind it, which are complete without it: three, by Capture::kHalfPeriodsToWait.
  static constexpr OutletSpec kSets{"blend", OutletPolicy::kLossless, 3, 1};
  static constexpr std::size_t kMaxBuffers = 60;
  static constexpr std::size_t kRaymapsWaiting = 2;
  static constexpr std::size_t kSeamChangesWaiting = 64;

 private:
  // The next band, packed in one 64-bit value: {round number, bands in the round, next band}. One compare-and-swap
  // covers all three. With the count in a separate variable, a thread could compare a band number of the last round
  // with the count of the next round and take a band that does not exist yet. A band is a piece of a sets::Round.
  static constexpr int kBandBits = 16;
  static constexpr std::uint64_t kMostBands = (std::uint64_t{1} << kBandBits) - 1;
  static std::uint64_t band_of(std::uint64_t ticket) { return ticket & kMostBands; }
  static std::uint64_t bands_of(std::uint64_t ticket) { return (ticket >> kBandBits) & kMostBands; }

  bool run_band();
  bool coordinate();
  bool finish();
  bool adopt();
  void move_seams(std::uint64_t set);
  void log_seams(std::uint64_t set);
  bool begin();
  bool next_round();
  void begin_blend();
  void count_undecodable();
  void request_seams();
  void begin_raymap();
  void start_round(std::uint64_t bands);
  bool take_pixels(std::size_t count);
  void measure();

  const RaymapConfig config_;
  hal::ClockPort& clock_;
  Outlet<SetLoan>& sets_in_;
  LoanPool<LineVector> pixels_pool_;
  SpscRing<sets::BlendSetup> tables_in_;
  SpscRing<sets::BlendSetup> tables_out_;
  SpscRing<Raymap> raymaps_out_;
  SpscRing<SeamRequest> seams_out_;
  SpscRing<SeamAnswer> seams_in_;
  SpscRing<SeamChange> seam_changes_out_;
  Snapshot<std::string> seams_refused_;
  SpscRing<blend::SphereLight> light_out_;
  SpscRing<Adoption> adoptions_out_;
  Snapshot<Adoption> adoption_;
  std::atomic<std::uint64_t> sets_begun_{0};

  // Written between raymaps, only by the thread that holds coordinating_.
  std::atomic_flag coordinating_;
  sets::SetBlend blend_;
  sets::SeamSchedule seams_;
  bool logs_seams_ = false;
  std::optional<SeamChange> seam_change_;  ///< waits for room in seam_changes_out_
  bool adoption_unreported_ = false;       ///< goes to adoptions_out_ with the next set
  std::uint64_t round_ = 0;
  SetLoan set_;                       ///< the set being blended
  std::size_t field_ = 0;             ///< index of the field being blended, and of its table
  std::array<PixelsLoan, 2> pixels_;  ///< for the raymaps still to be made from set_
  Instant begun_;

  // The raymap being blended, once its pixels are there. Constant while threads work on its bands.
  Raymap raymap_;
  std::atomic<std::uint64_t> next_band_{0};
  std::atomic<std::uint64_t> bands_done_{0};

  std::atomic<std::uint32_t> every_{1};
  Counts counts_;
  std::array<Undecodable, kMaxHeads> undecodable_;
  RecentTimes times_;
  std::atomic<bool> idle_{true};
  std::atomic<std::uint64_t> progress_{0};
};

}  // namespace nodal::firmware
