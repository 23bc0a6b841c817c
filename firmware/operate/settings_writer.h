#pragma once

#include <optional>
#include <string>

#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Schedules the writes of the settings and keeps the result of the last one: at most one write every kWriteEvery;
/// after a failure, a retry every kRetryEvery until one succeeds.
///
/// Threading: thread-bound to control; SettingsStore writes.
/// Ownership: none.
/// Errors: none; problem() is the reason why settings will be lost at the next start.
class SettingsWriter {
 public:
  /// A setting has changed that is not written yet.
  void changed() { dirty_ = true; }
  /// The file of an earlier run cannot be used. The next write replaces it.
  void unreadable(std::string problem) { problem_ = std::move(problem); }

  /// Whether to give the settings to the SettingsStore now.
  bool due(Instant now) const;
  void begun(Instant now);
  /// The result of the write that begun() recorded. True when problem() changed.
  bool ended(const Status& stored);

  /// Whether a reply should wait for the result of the current write.
  bool worth_waiting(Instant now) const { return writing_ && now - begun_ < kAnswerWithin; }
  /// A sentence while settings would not survive a restart; else empty.
  const std::string& problem() const { return problem_; }

  /// Limits the wear of flash during many changes in a row.
  static constexpr Duration kWriteEvery = Duration::seconds(1);
  static constexpr Duration kRetryEvery = Duration::seconds(10);
  static constexpr Duration kAnswerWithin = Duration::seconds(1);  ///< the most that a slow disk delays a reply

 private:
  bool dirty_ = false;
  bool writing_ = false;
  bool failed_ = false;  ///< the last write failed
  Instant begun_;        ///< start of the last write
  bool ever_ = false;    ///< begun_ is valid
  std::string problem_;
};

}  // namespace nodal::firmware
