// The stage that blends frame sets into raymaps, on as many threads as call it.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/frame/installed_calibration.h"
#include "firmware/frame/outlet.h"
#include "firmware/frame/raymap.h"
#include "firmware/frame/statistics.h"
#include "hal/clock.h"
#include "protocol/base/image.h"
#include "protocol/base/spsc_ring.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/prepare.h"

namespace nodal::firmware {

/// Every call of step() does one piece of work: a head's picture prepared where the table asks for it or, when all
/// are, a band of rows of the raymap under way; or what comes between: finishing a raymap, adopting a new calibration,
/// taking the next set. So a swap of calibrations always falls between two sets, and every raymap names the one
/// calibration that made it. A calibration with a table a field makes two raymaps of each set, one after the other: the
/// fields are read where they lie in the frames. No thread ever waits for another: whoever finds nothing to do goes away.
///
/// Threading: step() is thread-safe; the outlet's and the rings' other ends are capture's, the encoder's, the keeper's and
///   control's, one thread each; the counts may be read by any.
/// Ownership: holds a loan of the set under way; its pool lends the pixels that go with a raymap.
/// Errors: none; sets that make no raymap are counted.
class Blender {
 public:
  Blender(const RaymapConfig& config, hal::ClockPort& clock, Outlet<SetLoan>& sets_in);

  /// True when it did something.
  bool step();
  /// Ends: gives every set back. No thread may be in step() any more.
  void close();

  Outlet<SetLoan>& sets_in() { return sets_in_; }
  SpscRing<InstalledPtr>& tables_in() { return tables_in_; }
  /// Calibrations that are no longer in force, to be freed off the frame path.
  SpscRing<InstalledPtr>& tables_out() { return tables_out_; }
  SpscRing<Raymap>& raymaps_out() { return raymaps_out_; }
  /// What the heads of each blended set saw. When nobody takes it, the newest are left out.
  SpscRing<blend::SphereLight>& light_out() { return light_out_; }
  /// From which set on a calibration is in force.
  struct Adoption {
    std::uint64_t first_set = 0;
    Sha256 calibration{};
  };
  SpscRing<Adoption>& adoptions_out() { return adoptions_out_; }
  /// Every set with a lower number has been begun, left out or missed: adoptions_out() has named its calibration.
  std::uint64_t sets_begun() const { return sets_begun_.load(std::memory_order_acquire); }

  /// Of so many sets one is blended. Any thread.
  void set_every(std::uint32_t every) { every_.store(every, std::memory_order_relaxed); }

  struct Counts {
    std::atomic<std::uint64_t> blended{0};              ///< raymaps
    std::atomic<std::uint64_t> without_calibration{0};  ///< sets
    std::atomic<std::uint64_t> shed{0};                 ///< sets: the board is overloaded
    std::atomic<std::uint64_t> without_buffer{0};       ///< sets: every buffer was still with a client
    std::atomic<std::uint64_t> unfit_frames{0};         ///< frames that are not what the calibration is for
    std::atomic<std::uint64_t> adopted{0};              ///< calibrations taken into force
  };
  const Counts& counts() const { return counts_; }
  const RecentTimes& times() const { return times_; }
  /// Rises with every piece of work; while !idle(), it must.
  std::uint64_t progress() const { return progress_.load(std::memory_order_relaxed); }
  /// No set is waiting or under way.
  bool idle() const { return idle_.load(std::memory_order_acquire); }

  /// What it wants of the frame sets: all that may come at once. When a head falls silent, the set that waited for it goes
  /// on together with those behind it, which are complete without it: three, by Capture::kHalfPeriodsToWait.
  static constexpr OutletSpec kSets{"blend", OutletPolicy::kLossless, 3, 1};
  static constexpr int kBandRows = 64;
  static constexpr std::size_t kMaxBuffers = 60;
  static constexpr std::size_t kRaymapsWaiting = 2;

 private:
  // The band to take next, in one word: the number of the round, how many bands the round has, the band. All three are read
  // and compared at once: if the count lay in a word of its own, a thread could hold a band of the last round against the
  // count of the next, and take one that nobody handed out. While heads are prepared, a head is a band.
  static constexpr int kBandBits = 16;
  static constexpr std::uint64_t kMostBands = (std::uint64_t{1} << kBandBits) - 1;
  static std::uint64_t band_of(std::uint64_t ticket) { return ticket & kMostBands; }
  static std::uint64_t bands_of(std::uint64_t ticket) { return (ticket >> kBandBits) & kMostBands; }

  bool run_band();
  bool coordinate();
  bool finish();
  bool adopt();
  bool begin();
  void begin_raymap();
  void take_pictures(const FrameSet& set);
  const blend::BlendTable& table() const { return installed_->tables[field_]; }
  void hand_out(std::uint64_t bands);
  bool take_pixels(std::size_t count);
  void undo_exposures(const FrameSet& set);
  void measure();

  const RaymapConfig config_;
  const std::uint64_t bands_;
  hal::ClockPort& clock_;
  Outlet<SetLoan>& sets_in_;
  LoanPool<std::vector<std::uint8_t>> pixels_pool_;
  SpscRing<InstalledPtr> tables_in_;
  SpscRing<InstalledPtr> tables_out_;
  SpscRing<Raymap> raymaps_out_;
  SpscRing<blend::SphereLight> light_out_;
  SpscRing<Adoption> adoptions_out_;
  std::atomic<std::uint64_t> sets_begun_{0};

  // Between raymaps, by whoever holds coordinating_.
  std::atomic_flag coordinating_;
  InstalledPtr installed_;
  bool adoption_to_tell_ = false;  ///< with the next set
  std::uint64_t round_ = 0;
  std::array<blend::ExposedHead, kMaxHeads> exposed_{};  ///< as they last were
  HeadMask was_exposed_ = 0;                             ///< those that ever were
  SetLoan set_;                                          ///< under way
  std::size_t field_ = 0;                                ///< of it: which of the tables
  std::array<Buffer, 2> pixels_;                         ///< for the raymaps that are still to be made of it
  Instant begun_;

  // The raymap under way; still while bands of it are out.
  Raymap raymap_;
  struct ToPrepare {
    const blend::BlendTable::Source* source = nullptr;
    ImageView picture;
    std::uint8_t* memory = nullptr;
    std::size_t index = 0;
  };
  std::array<ToPrepare, kMaxHeads> to_prepare_;
  std::size_t heads_to_prepare_ = 0;
  bool preparing_ = false;
  std::array<ImageView, kMaxHeads * blend::kMaxLevels> pictures_;  ///< as blend::Pictures has them
  blend::SetTone tone_;
  MutableImageView into_;
  std::atomic<std::uint64_t> next_band_{0};
  std::atomic<std::uint64_t> bands_done_{0};

  std::atomic<std::uint32_t> every_{1};
  Counts counts_;
  RecentTimes times_;
  std::atomic<bool> idle_{true};
  std::atomic<std::uint64_t> progress_{0};
};

}  // namespace nodal::firmware
