// The stage that copies the pictures of every set for the disk. It waits for nothing, so sets are released at once.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/frame/outlet.h"
#include "firmware/frame/raymap.h"
#include "firmware/picture/encoder.h"
#include "firmware/record/head_streams.h"
#include "firmware/record/picture_ring.h"
#include "firmware/record/still.h"
#include "firmware/record/take_row.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

/// What the TakeKeeper orders the recorder to do.
struct RecordOrder {
  enum class Kind : std::uint8_t { kBegin, kEnd };
  Kind kind = Kind::kEnd;
  std::uint64_t take = 0;
  bool raymaps = false;  ///< kBegin: raymaps are recorded, too
  bool still = false;    ///< kBegin: the take ends after one set
};

/// Groups sets to rows, which the disk's stage writes as clusters. All heads' clusters have the same sets. If the disk
/// is slow and the ring fills, it first leaves out raymaps, above kRaymapsUpTo, and encodes pictures with a lower
/// quality, which the evidence states; a set for which there is no room at all is lost for every head, and counted.
///
/// Threading: step() is thread-bound to the recorder. orders(), rows() and rows_back() are SPSC rings with the disk's
///   stage, which also releases the ring's memory. The counts are for any thread.
/// Ownership: owns the ring and the rows; holds a set only during a step.
/// Errors: none; what is not recorded is counted.
class Recorder {
 public:
  Recorder(const RigConfig& config, Outlet<SetLoan>& sets_in, EncodeStage& encoder);

  /// True when it did something.
  bool step();

  SpscRing<RecordOrder>& orders() { return orders_; }
  SpscRing<std::unique_ptr<TakeRow>>& rows() { return rows_; }
  SpscRing<std::unique_ptr<TakeRow>>& rows_back() { return rows_back_; }
  PictureRing& ring() { return ring_; }
  /// No set waits, and every closed row was written or is being written. Any thread.
  bool idle() const { return sets_in_.empty() && raymaps_in_.empty() && rows_.empty(); }

  /// Quality of JPEGs that are encoded now: lower while the ring fills. Any thread.
  int quality_now() const;
  bool leaves_out_raymaps() const { return 100 * ring_.used() > kRaymapsUpTo * ring_.size(); }

  struct Counts {
    std::atomic<std::uint64_t> sets{0};          ///< recorded sets of all takes since nodald started
    std::atomic<std::uint64_t> lost_sets{0};     ///< sets for which the ring had no room
    std::atomic<std::uint64_t> lost_raymaps{0};  ///< raymaps for which the ring had no room
    std::atomic<std::uint64_t> placeholders{0};  ///< frames that were replaced by a placeholder
    std::atomic<std::uint64_t> set_bytes{0};     ///< size of the newest recorded set
  };
  const Counts& counts() const { return counts_; }

  static constexpr OutletSpec kSets{"record", OutletPolicy::kLossless, 3, 1};
  static constexpr OutletSpec kRaymaps{"record", OutletPolicy::kLossless, 4, 1};
  static constexpr std::size_t kRows = 64;
  /// Percentage of the ring in use above which raymaps are left out.
  static constexpr std::size_t kRaymapsUpTo = 50;
  /// The quality is that of [takes], lower by this for each full quarter of the ring, but at least kMinQuality.
  static constexpr int kQualityStep = 15;
  static constexpr int kMinQuality = 30;

 private:
  bool run_orders();
  void record(const FrameSet& set);
  bool copy(const FrameSet& set, RecordedSet& to);
  void record(const Raymap& raymap);
  bool open_row();
  void close_row(bool last);
  bool changes_rate(const FrameSet& set);
  void begin_end();

  const std::size_t heads_;
  const int quality_;  ///< quality of JPEGs that rig.toml wants
  Outlet<SetLoan>& sets_in_;
  EncodeStage& encoder_;
  Outlet<Raymap>& raymaps_in_;
  SpscRing<RecordOrder> orders_;
  SpscRing<std::unique_ptr<TakeRow>> rows_;
  SpscRing<std::unique_ptr<TakeRow>> rows_back_;
  PictureRing ring_;
  Counts counts_;

  std::optional<std::uint64_t> take_;
  bool ending_ = false;  ///< the last row waits for a place in rows()
  Still still_;
  HeadStreams streams_;
  FrameRate rate_;
  std::vector<std::unique_ptr<TakeRow>> spare_;
  std::unique_ptr<TakeRow> row_;  ///< the row that sets are added to
  std::array<std::size_t, kMaxHeads> row_bytes_{};
  std::uint64_t missed_ = 0;  ///< sets that were lost since the newest recorded one
};

}  // namespace nodal::firmware
