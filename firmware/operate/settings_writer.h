#pragma once

#include <optional>
#include <string>

#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// When settings are written, and what is known about their last writing: at most one write every kWriteEvery, and
/// after a failure another attempt every kRetryEvery until one succeeds.
///
/// Threading: thread-bound to control; SettingsStore writes.
/// Ownership: none.
/// Errors: none; problem() says why settings would be lost at the next start.
class SettingsWriter {
 public:
  /// A setting was made that is not written yet.
  void changed() { dirty_ = true; }
  /// What an earlier run stored cannot be used. The next write replaces it.
  void unreadable(std::string problem) { problem_ = std::move(problem); }

  /// Whether to hand the settings to the SettingsStore now.
  bool due(Instant now) const;
  void begun(Instant now);
  /// How the write that begun() noted ended. True when problem() changed.
  bool ended(const Status& stored);

  /// Whether a reply should wait for the write under way, so that it can say how it ended.
  bool worth_waiting(Instant now) const { return writing_ && now - begun_ < kAnswerWithin; }
  /// A sentence while settings would not survive a restart; else empty.
  const std::string& problem() const { return problem_; }

  static constexpr Duration kWriteEvery = Duration::seconds(1);  ///< somebody may be turning a knob; disks wear out
  static constexpr Duration kRetryEvery = Duration::seconds(10);
  static constexpr Duration kAnswerWithin = Duration::seconds(1);  ///< a disk that hangs delays a reply by no more

 private:
  bool dirty_ = false;
  bool writing_ = false;
  bool failed_ = false;  ///< the last write
  Instant begun_;        ///< of the last write
  bool ever_ = false;    ///< begun_ is set
  std::string problem_;
};

}  // namespace nodal::firmware
