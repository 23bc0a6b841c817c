// Blends the sets of a take to raymaps, after it was recorded.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/field.h"
#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"
#include "stitch/media/take/take_folder.h"
#include "stitch/parallel/workers.h"
#include "stitch/sets/seam_schedule.h"
#include "stitch/sets/set_blend.h"

namespace nodal::render {

struct RenderOptions {
  std::optional<Calibration> calibration{};  ///< instead of the take's
  RaymapConfig raymap;                       ///< such as that of the take's rig.toml
  /// Sets whose middle is from this long after the first set's on, and less than that.
  Duration from{};
  Duration to = Duration::seconds(1'000'000'000);
  int threads = 0;  ///< 0: one per core. The bytes do not depend on it.
};

/// [raymap] of the rig.toml in a take. Errors: those of the file.
Result<RaymapConfig> raymap_of(const media::TakeFolder& folder);

struct RenderedRaymap {
  DecodedImage pixels;
  Instant mid_exposure;                        ///< middle of this field's exposure
  std::uint32_t heads = 0;                     ///< bit i: head i of the take is in it
  std::optional<blend::LinearScale> linear{};  ///< scale of raymaps of 16 bits
  std::optional<int> field{};                  ///< 0: the set's earlier field, 1: the later one; empty: a whole frame
  FieldParity parity{};                        ///< parity of that field
  std::size_t undecodable_heads = 0;           ///< heads of the set whose pictures could not be decoded
};

/// With the take's calibrations, each for the sets that the rig blended with it, and pictures as the heads delivered
/// them, the bytes are those of the rig's own raymaps: the same code makes them, with the settings and the placed seams
/// that the evidence has. Without seams in it, as with another calibration, they are placed anew from the first set on.
/// Every set is rendered, also those that the rig had no time to blend.
///
/// Threading: thread-bound; starts its own threads and waits for them.
/// Ownership: the folder outlives it.
/// Errors: those of TakeFolder, of the calibration, and of table::TableCompiler.
class TakeRender {
 public:
  /// kNotReady if there is no calibration in the take and in the options; kHeadMismatch if it is for other heads.
  static Result<std::unique_ptr<TakeRender>> make(const media::TakeFolder& folder, RenderOptions options);

  /// The next raymap; false after the last. `compiled` is told the part of a table that is compiled, 0 to 1.
  Result<bool> next(RenderedRaymap& into, const std::function<void(double)>& compiled = {});
  /// Goes to a raymap of the take, counted from 0: next() gives it, with the bytes that it has after those before it.
  /// Where the take has no seams, the given ones are in force from now on, and none are placed; empty: those of the
  /// calibration.
  void seek(std::uint64_t raymap, std::vector<std::uint8_t> seams);
  /// Seams that suit the set of a raymap, near the given ones. Empty: the take has seams there, or none are placed.
  /// Moves the position: call seek() next.
  Result<std::vector<std::uint8_t>> suitable_seams(std::uint64_t raymap, std::vector<std::uint8_t> before);
  /// The calibrations that raymaps are made with, in order; at least one.
  std::vector<const Calibration*> calibrations() const;
  /// The set of the newest raymap, with the head's settings.
  const media::TakeSet& set() const { return set_; }
  /// Of the newest raymap.
  const Sha256& calibration() const { return used_->id; }
  /// Of the newest raymap: at which raymaps came when it was recorded. Nothing if it is above what a FrameRate can be.
  std::optional<FrameRate> rate();
  /// Whether the rig used this calibration for any set of the take.
  bool is_of_take() const { return of_take_; }

 private:
  struct Used {
    Calibration calibration;
    Sha256 id{};
    std::uint64_t first_set = 0;  ///< number of the first set that is blended with it
    bool stored = true;           ///< false: the take has it not, nor any later one
  };
  TakeRender(const media::TakeFolder& folder, RenderOptions options, std::vector<Used> calibrations);
  Result<bool> next_set(const std::function<void(double)>& compiled);
  Status use_tables(const std::function<void(double)>& compiled);
  void begin_set(bool views);
  void run_rounds();
  bool has_seams();
  Status use_seams();
  Status use_given_seams();
  Status place_seams(std::uint64_t set);
  void blend(RenderedRaymap& into);

  const media::TakeFolder& folder_;
  RenderOptions options_;
  std::vector<Used> calibrations_;  ///< at least one, in order
  const Used* used_;                ///< calibration of the newest set
  parallel::Workers workers_;
  media::TakeSets sets_;
  media::TakeSet set_;
  std::optional<Instant> first_;          ///< middle of the take's first set
  std::optional<std::uint32_t> segment_;  ///< number of the segment that the tables were compared with
  const Used* compiled_ = nullptr;        ///< calibration of the tables
  std::vector<PixelFormat> formats_;      ///< formats that the tables are for
  std::optional<Fields> fields_;          ///< field order that the tables are for
  sets::SetBlend blend_;
  sets::PlanPtr own_seams_;     ///< the plan as compiled
  sets::SeamSchedule seams_;    ///< the seams of this plan
  std::size_t next_field_ = 0;  ///< next field of the set that was read; 0: the next set comes first
  struct Seek {
    std::uint64_t first_set = 0;  ///< index of the first set to render
    std::uint64_t next_set = 0;   ///< index of the set that is read next
    bool second_field = false;    ///< the first raymap to render is the second of its set
  } seek_;
  std::optional<std::vector<std::uint8_t>> given_;  ///< seams of seek()
  std::size_t undecodable_ = 0;
  bool of_take_ = true;
};

}  // namespace nodal::render
