// Heads and a trigger whose answers are noted in a log.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware/capture/capture_log.h"
#include "hal/head.h"
#include "hal/trigger.h"

namespace nodal::firmware {

/// Threading: thread-bound to capture.
/// Ownership: the other enumerator and the log outlive it and its heads.
/// Errors: those of the other ports.
class LoggedHeads final : public hal::HeadEnumerator {
 public:
  /// `paths`: by head.
  LoggedHeads(hal::HeadEnumerator& heads, std::vector<std::string> paths, CaptureLog& log)
      : heads_(heads), paths_(std::move(paths)), log_(log) {}
  Result<std::unique_ptr<hal::HeadPort>> open(const std::string& path) override;
  std::vector<hal::HeadIdentity> list() override { return heads_.list(); }

 private:
  hal::HeadEnumerator& heads_;
  const std::vector<std::string> paths_;
  CaptureLog& log_;
};

/// Threading, ownership and errors: as LoggedHeads; make_safe() by any thread.
class LoggedTrigger final : public hal::TriggerPort {
 public:
  LoggedTrigger(hal::TriggerPort& trigger, CaptureLog& log) : trigger_(trigger), log_(log) {}
  Status start(const hal::TriggerSettings& settings) override;
  void stop() override;
  Result<std::optional<hal::TriggerEdge>> take_edge() override;
  void add_wake_ups(hal::WakeUps& to) const override { trigger_.add_wake_ups(to); }
  hal::TriggerCounts counts() const override { return trigger_.counts(); }
  void make_safe() noexcept override { trigger_.make_safe(); }

 private:
  hal::TriggerPort& trigger_;
  CaptureLog& log_;
};

}  // namespace nodal::firmware
