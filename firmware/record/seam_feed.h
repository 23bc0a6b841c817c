// The placed seams that the blend logs, on their way to the take that is recorded.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/picture/seam_log.h"
#include "firmware/record/take_row.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

class TakeWriter;

/// A row is written after the blend has begun its sets, because then the blend has logged their seams. The row is
/// written without waiting if the blend has begun no set for kBlendWithin.
///
/// Threading: thread-bound to the takes' stage.
/// Ownership: the log outlives it.
/// Errors: none.
class SeamFeed {
 public:
  /// `log`: the blend's, which is opened; null if seams are fixed.
  explicit SeamFeed(SeamLog* log);

  /// Takes what the blend has logged, and passes it to `writer`; null: no take is recorded, or its disk failed. True
  /// when there was something.
  bool step(TakeWriter* writer);
  /// A take begins: the seams that are in force come first.
  void begin(TakeWriter& writer) const;
  /// Whether the blend may still log seams for the row's sets.
  bool is_behind(const TakeRow& row, Instant now);
  /// The blend does not go on; nothing waits for it any more.
  void close() { closing_ = true; }

  static constexpr Duration kBlendWithin = Duration::seconds(1);

 private:
  SeamLog* const log_;
  std::optional<SeamChange> newest_;
  std::uint64_t begun_ = 0;  ///< SeamLog::sets_begun() when it was last read
  Instant begun_at_;
  bool closing_ = false;
};

}  // namespace nodal::firmware
