// An output line that one thread writes and that any thread can make safe permanently.
#pragma once

#include <atomic>
#include <memory>

#include "hal/linux/gpio/system.h"

namespace nodal::hal::gpio {

/// Threading: write() from one thread; make_safe() and safe() from any.
/// Ownership: owns the line; the destructor leaves it at its safe level.
class OutputLine {
 public:
  OutputLine(LineName name, std::unique_ptr<Line> line, bool safe_level)
      : name_(std::move(name)), line_(std::move(line)), safe_level_(safe_level) {}
  ~OutputLine();
  OutputLine(const OutputLine&) = delete;
  OutputLine& operator=(const OutputLine&) = delete;

  const LineName& name() const { return name_; }
  bool safe_level() const { return safe_level_; }
  /// 0, an errno, or ECANCELED after make_safe().
  int write(bool high);
  /// Waits for no lock, and at most 2 ms for a write that is under way. A write that hangs puts the line to its safe
  /// level itself when it returns.
  void make_safe() noexcept;
  bool safe() const { return safe_.load(); }

 private:
  const LineName name_;
  const std::unique_ptr<Line> line_;
  const bool safe_level_;
  std::atomic<bool> safe_{false};     ///< the line keeps its safe level permanently
  std::atomic<bool> writing_{false};  ///< write() is in the driver
};

/// The line, claimed at its safe level; or explain_claim()'s error.
Result<std::unique_ptr<OutputLine>> claim_output(System& system, const LineName& name, bool safe_level);

}  // namespace nodal::hal::gpio
