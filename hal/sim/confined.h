// A ConfinedPort that does its work in the calling thread.
#pragma once

#include <optional>
#include <utility>

#include "hal/confined.h"

namespace nodal::hal::sim {

/// A job is done when its result is asked for the second time.
///
/// Threading: thread-bound. Ownership, errors: as ConfinedPort.
class SimConfined final : public ConfinedPort {
 public:
  explicit SimConfined(ConfinedWork work) : work_(std::move(work)) {}

  // What the stage sees.
  Status begin(ConfinedJob job) override;
  std::optional<Result<std::vector<std::uint8_t>>> take_result() override;
  std::uint64_t progress() const override { return progress_; }
  void end() override { job_.reset(); }

  // What a test does.
  /// The next jobs crash before they have done anything, until this is called with false.
  void crash(bool on = true) { crashes_ = on; }
  /// Jobs do not end before this is called with false.
  void hold(bool on = true) { holds_ = on; }
  /// No more jobs can be done.
  void lose() { lost_ = true; }
  /// Jobs that were begun.
  int begun() const { return begun_; }

 private:
  const ConfinedWork work_;
  std::optional<ConfinedJob> job_;
  bool asked_ = false, crashes_ = false, holds_ = false, lost_ = false;
  std::uint64_t progress_ = 0;
  int begun_ = 0;
};

}  // namespace nodal::hal::sim
