// Writes down what heads do, whatever they are connected by (`nodald --log capture=debug`, or capture=trace).
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/head.h"

namespace nodal::daemon {

/// Passes every call on. At level debug it writes openings, starts, settings, frames that are not good, gaps in the
/// device's own count and a head without a frame for a second; at level trace also every frame.
///
/// Threading: as HeadEnumerator.
/// Ownership: `heads` and `clock` outlive it and its heads.
class TracedHeads final : public hal::HeadEnumerator {
 public:
  TracedHeads(hal::HeadEnumerator& heads, hal::ClockPort& clock) : heads_(heads), clock_(clock) {}
  Result<std::unique_ptr<hal::HeadPort>> open(const std::string& path) override;
  std::vector<hal::HeadIdentity> list() override { return heads_.list(); }

 private:
  hal::HeadEnumerator& heads_;
  hal::ClockPort& clock_;
  std::map<std::string, std::string> results_;  ///< by path, of its newest opening: only changes are written
};

}  // namespace nodal::daemon
