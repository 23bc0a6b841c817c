#include "firmware/health.h"

#include <algorithm>
#include <cstdio>

namespace nodal::firmware {
namespace {

constexpr Duration kSilence = Duration::milliseconds(1500);
constexpr Duration kSettling = Duration::seconds(5);

std::string hertz(std::uint32_t millihertz) {
  char text[32];
  std::snprintf(text, sizeof text, "%u.%02u", millihertz / 1000, millihertz % 1000 / 10);
  return text;
}

/// "head 'cam3'", "heads 'cam3', 'cam4'" of those that are away, with the first one's reason.
std::string absent_heads(const RigConfig& config, const CaptureReport& capture) {
  std::string names, reason;
  std::size_t count = 0;
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    const HeadReport& head = capture.heads[i];
    if (head.present) continue;
    names += (count++ == 0 ? "'" : ", '") + config.heads[i].name + "'";
    if (reason.empty()) reason = head.problem;
  }
  if (count == 0) return "";
  return (count == 1 ? "head " : "heads ") + names + (count == 1 ? " is" : " are") + " not there: " + reason;
}

std::string first_head_problem(const RigConfig& config, const CaptureReport& capture) {
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    if (capture.heads[i].present && !capture.heads[i].problem.empty()) {
      return "head '" + config.heads[i].name + "': " + capture.heads[i].problem;
    }
  }
  return "";
}

/// What makes raymaps worse than they should be; empty when nothing does.
std::string degradation(const RigConfig& config, const Signs& signs) {
  if (std::string absent = absent_heads(config, signs.capture); !absent.empty()) return absent;
  if (signs.capture.genlock.state == GenlockState::kLost) {
    return "the genlock is lost: heads no longer follow the trigger";
  }
  if (signs.capture.genlock.state == GenlockState::kHoldover) {
    return "the trigger's pulses are not seen; the heads still run in step";
  }
  if (signs.unfit_frames > 0) return "frames come that are not of the size or format the calibration is for";
  if (!signs.keeper.problem.empty()) return signs.keeper.problem;
  if (std::string problem = first_head_problem(config, signs.capture); !problem.empty()) return problem;
  const std::uint64_t enough = std::uint64_t{signs.rate_wanted_millihertz} * 95 / 100;
  if (signs.blending > kSettling && signs.rate_millihertz > 0 && signs.rate_millihertz < enough) {
    return hertz(signs.rate_millihertz) + " raymaps a second are made of the rig's " +
           hertz(signs.rate_wanted_millihertz) + "; the board is too slow for this size, or busy";
  }
  return "";
}

}  // namespace

Health assess(const RigConfig& config, const Signs& signs) {
  if (!signs.keeper.ready) {
    return {"starting", signs.keeper.activity.empty() ? "reading the calibration store" : signs.keeper.activity};
  }
  if (!signs.keeper.in_force) {
    return {"no-calibration", signs.keeper.problem.empty()
                                  ? "no calibration is in force; upload one: nodal calibration upload FILE"
                                  : signs.keeper.problem};
  }
  if (signs.since_last_set > kSilence) {
    const std::string absent = absent_heads(config, signs.capture);
    return {"idle", "no frames are coming" + (absent.empty() ? std::string() : "; " + absent)};
  }
  if (std::string why = degradation(config, signs); !why.empty()) return {"degraded", why};
  return {"running", ""};
}

void ProgressMonitor::step(const std::vector<Stage>& stages, const Health& health, Instant now) {
  if (!watchdog_) return;
  if (fed_ && now - *fed_ < kFeedEvery) return;
  if (!fed_) watchdog_->ready();
  seen_.resize(stages.size(), Seen{0, now});
  stuck_.reset();
  for (std::size_t i = 0; i < stages.size(); ++i) {
    if (stages[i].may_rest || stages[i].progress != seen_[i].progress) {
      seen_[i] = {stages[i].progress, now};
    } else if (now - seen_[i].at > kStuckAfter) {
      stuck_ = std::string(stages[i].name);
    }
  }
  fed_ = now;
  if (!stuck_) watchdog_->feed();
  std::string line = stuck_ ? *stuck_ + " hangs" : health.state;
  if (!stuck_ && !health.problem.empty()) line += ": " + health.problem;
  if (line == told_) return;
  watchdog_->status(line);
  told_ = std::move(line);
}

}  // namespace nodal::firmware
