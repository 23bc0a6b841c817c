#include "firmware/capture/capture_pace.h"

#include <array>
#include <utility>

namespace nodal::firmware {
namespace {

hal::TriggerSettings settings_of(const RigConfig& config) {
  hal::TriggerSettings settings;
  settings.rate = config.rate;
  settings.follow = config.trigger.source == SyncSource::kExternal;
  settings.pulse_width = config.trigger.pulse_width;
  settings.active_high = config.trigger.active_high;
  for (std::size_t i = 0; i < config.heads.size(); ++i) {
    if (!config.heads[i].wired) settings.delay[i] = config.heads[i].trigger_delay;
  }
  return settings;
}

}  // namespace

CapturePace::CapturePace(const RigConfig& config, hal::TriggerPort* trigger, std::function<void(Instant)> close_sets)
    : trigger_{settings_of(config), config.trigger.source, config.trigger.start},
      close_sets_(std::move(close_sets)),
      genlock_(trigger),
      timing_(config) {
  timing_.restart(config.rate, false, Instant());
  aligner_.restart(config.rate.period());
}

Status CapturePace::start(const GenlockStart& start, Instant now) {
  const FrameRate configured = timing_.configured();
  if (trigger_.source == SyncSource::kNone) {
    if (start.pulse_width || (start.rate && start.rate->period() != configured.period())) {
      return fail(Errc::kUnsupported,
                  "this rig has no trigger ([trigger] source is \"none\"): its heads run free and can only be "
                  "aligned at the rate of rig.toml");
    }
    genlock_.align(configured, now);
    aligner_.restart(configured.period());
    return {};
  }
  hal::TriggerSettings settings = trigger_.settings;
  settings.rate = start.rate.value_or(settings.rate);
  settings.pulse_width = start.pulse_width.value_or(settings.pulse_width);
  if (Status started = genlock_.start(settings, now); !started) {
    stop(now);
    return started;
  }
  restart(hal::TriggerMode::kExternal, settings.rate, now);
  return {};
}

void CapturePace::stop(Instant now) {
  genlock_.stop();
  if (mode_ != hal::TriggerMode::kFreeRun) restart(hal::TriggerMode::kFreeRun, timing_.configured(), now);
}

void CapturePace::restart(hal::TriggerMode mode, FrameRate rate, Instant now) {
  mode_ = mode;
  close_sets_(now);
  timing_.restart(rate, mode == hal::TriggerMode::kExternal, now);
  aligner_.restart(rate.period());
}

bool CapturePace::step(Instant now) {
  genlock_.step(now);
  if (!std::exchange(trigger_.start, false)) return false;
  (void)start({}, now);  // on failure the state stays "off", which status shows
  return true;
}

bool CapturePace::take_edges(Instant now) {
  constexpr int kEdges = 256;  // bounds the work of one step; the next step takes the remaining edges
  int taken = 0;
  for (; taken < kEdges; ++taken) {
    const auto edge = genlock_.take_edge(now);
    if (!edge) break;
    timing_.on_edge(*edge);
  }
  return taken > 0;
}

std::optional<SetClock::Match> CapturePace::match(std::size_t head, const hal::FrameView& frame, Instant now) {
  const auto match = timing_.match(head, frame);
  if (match && match->trigger) return match;
  // The thread may have been suspended after it read the pulses of this step, so this frame's pulse may be unread.
  if (!take_edges(now)) return match;
  return timing_.match(head, frame);
}

void CapturePace::on_frame(std::size_t head, const SetClock::Match& match, const hal::FrameView& frame,
                           std::uint64_t starts) {
  if (match.trigger) timing_.add_pulsed(head, match, frame);
  if (pulsed()) return;
  timing_.add_free(head, match, frame);
  aligner_.on_frame(head, starts, frame);
}

void CapturePace::describe(SetClock::Slot slot, FrameSet& set, const Skews& skews) {
  timing_.describe(set, skews, pulsed());
  timing_.follow(slot, set);
}

void CapturePace::on_set(const FrameSet& set, const Skews& skews, bool every_present, Instant now) {
  if (genlock_.aligning()) {
    genlock_.on_set(set, aligner_.skews(set), every_present, now, aligner_.unresponsive());
    align_now_ = true;
  } else {
    genlock_.on_set(set, skews, every_present, now);
  }
}

void CapturePace::align(std::deque<CaptureHead>& heads, Instant now) {
  if (!std::exchange(align_now_, false) || !genlock_.aligning()) return;
  std::array<FreeHead, kMaxHeads> free;
  for (std::size_t i = 0; i < heads.size(); ++i) {
    if (!heads[i].streaming()) continue;
    free[i] = {true, heads[i].starts(), heads[i].report().limits->nudge, heads[i].pending_exposure()};
  }
  const bool in_step = genlock_.state() == GenlockState::kLocked || genlock_.state() == GenlockState::kHoldover;
  const Aligner::Nudges nudges = aligner_.plan(free, in_step, now);
  for (std::size_t i = 0; i < heads.size(); ++i) {
    if (nudges[i] != Duration()) heads[i].nudge(nudges[i]);
  }
}

GenlockReport CapturePace::report() const {
  GenlockReport report = genlock_.report();
  if (!genlock_.running()) report.rate = timing_.configured();
  if (genlock_.aligning()) {
    report.fixed = aligner_.fixed();
    report.one_way = aligner_.one_way();
    report.unresponsive = aligner_.unresponsive();
  }
  if (pulsed()) timing_.report_wired(report);
  report.drift_ppb = timing_.drift_ppb(pulsed());
  return report;
}

}  // namespace nodal::firmware
