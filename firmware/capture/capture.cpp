#include "firmware/capture/capture.h"

#include <algorithm>

#include "firmware/capture/capture_log.h"
#include "firmware/frame/drain.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kCommands = 64;
constexpr Duration kReportEvery = Duration::milliseconds(20);

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

Capture::Capture(const RigConfig& config, hal::HeadEnumerator& heads, hal::TriggerPort* trigger)
    : trigger_{settings_of(config), config.trigger.source, config.trigger.start},
      genlock_(trigger),
      exposure_(config.exposure),
      timing_(config),
      assembly_([this](FrameSet& set, std::uint32_t collection) { release_frames(set, collection); }),
      requests_(kCommands),
      answers_(kCommands) {
  for (const HeadConfig& head : config.heads) heads_.emplace_back(head, head.port.text(), heads);
  report_.heads.resize(heads_.size());
  restart_clocks(config.rate, false, Instant());
}

Capture::~Capture() { close(); }

void Capture::close() {
  close_all(Instant());
  for (Outlet<SetLoan>& outlet : assembly_.outlets()) outlet.drop_waiting();
  assembly_.collect();
  genlock_.stop();
  for (CaptureHead& head : heads_) head.close();
  update_report(Instant(), true);
}

bool Capture::step(Instant now) {
  now_ = now;
  if (log_) log_->note(StepBegun{now});
  assembly_.begin_step();
  bool busy = assembly_.collect();
  busy |= follow_light();
  busy |= run_commands(now);
  busy |= take_edges();
  for (CaptureHead& head : heads_) busy |= head.step(now, mode_);
  busy |= take_frames();
  busy |= close_due_sets(now);
  align();
  genlock_.step(now);
  if (std::exchange(trigger_.start, false)) {
    (void)start_genlock({}, now);  // on failure the state stays "off", which status shows
    busy = true;
  }
  check();
  if (log_) log_changes();
  update_report(now, busy);
  steps_.fetch_add(1, std::memory_order_relaxed);
  return busy;
}

void Capture::add_wake_ups(hal::WakeUps& to) const {
  for (const CaptureHead& head : heads_) head.add_wake_ups(to);
  genlock_.add_wake_ups(to);
  if (!assembly_.empty()) to.at(due(assembly_.oldest()));
  to.at(next_report_);
}

void Capture::restart_clocks(FrameRate rate, bool genlocked, Instant now) {
  timing_.restart(rate, genlocked, now);
  aligner_.restart(rate.period());
}

bool Capture::take_edges() {
  constexpr int kEdges = 256;  // bounds the work of one step; the next step takes the remaining edges
  int taken = 0;
  for (; taken < kEdges; ++taken) {
    const auto edge = genlock_.take_edge(now_);
    if (!edge) break;
    timing_.on_edge(*edge);
  }
  return taken > 0;
}

bool Capture::run_commands(Instant now) {
  bool any = false;
  for (std::size_t taken = 0; taken < requests_.capacity() && !answers_.full(); ++taken) {
    auto command = requests_.pop();
    if (!command) break;
    any = true;
    if (log_) log_->note(CommandTaken{*command});
    Status status;
    if (const auto* change = std::get_if<HeadChange>(&command->what)) {
      status = change_heads(*change);
    } else if (const auto* start = std::get_if<GenlockStart>(&command->what)) {
      status = start_genlock(*start, now);
    } else if (const auto* exposing = std::get_if<ExposureChange>(&command->what)) {
      exposure_.set(exposing->applied_to(exposure_.report().settings));
    } else if (const auto* end = std::get_if<LeaseEnd>(&command->what)) {
      status = end_lease(end->lease);
    } else {
      stop_genlock(now);
    }
    if (log_) log_->note(CommandAnswered{command->ticket, status});
    answers_.push(CaptureAnswer{command->ticket, now, std::move(status), genlock_report(), exposure_.report()});
  }
  return any;
}

bool Capture::follow_light() {
  if (!light_in_) return false;
  return drain(*light_in_, [&](const blend::SphereLight& seen) {
    if (log_) log_->note(LightTaken{seen});
    std::array<std::optional<ExposureRange>, kMaxHeads> ranges;
    const ExposureSettings& automatic = exposure_.report().settings;
    for (std::size_t i = 0; i < heads_.size(); ++i) {
      const HeadReport& head = heads_[i].report();
      if (!head.present || !head.limits) {
        exposure_.forget(i);
        continue;
      }
      const hal::HeadLimits& limits = *head.limits;
      ranges[i] = {limits.exposure_min, std::clamp(automatic.longest, limits.exposure_min, limits.exposure_max),
                   limits.gain_min, std::clamp(automatic.highest, limits.gain_min, limits.gain_max)};
    }
    const ExposureControl::Orders orders = exposure_.step(seen, ranges);
    for (std::size_t i = 0; i < heads_.size(); ++i) {
      if ((orders.heads & head_bit(i)) == 0) continue;
      // The values are within the head's limits. A head that has just disappeared gets them when it returns.
      (void)heads_[i].change({orders.of[i].exposure, orders.of[i].gain, std::nullopt, std::nullopt});
      align_now_ = true;
    }
  });
}

Status Capture::change_heads(const HeadChange& change) {
  const ExposureSettings& exposing = exposure_.report().settings;
  if ((change.change.exposure || change.change.gain) && exposing.program != ExposureProgram::kManual &&
      !exposing.locked) {
    return fail(Errc::kWrongState, "the exposure program '" + std::string(exposure_program_name(exposing.program)) +
                                       "' sets exposures and gains; run `nodal exposure set manual` or `nodal exposure "
                                       "lock` first");
  }
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if ((change.heads & head_bit(i)) == 0) continue;
    Status allowed = heads_[i].check(change.change);
    if (allowed && change.lease != 0) allowed = heads_[i].check_lease(change.lease);
    if (!allowed) return allowed;
  }
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if ((change.heads & head_bit(i)) == 0) continue;
    NODAL_TRY(heads_[i].change(change.change, change.lease));
    align_now_ = true;
  }
  return {};
}

/// Every head is restored, also after an error of another.
Status Capture::end_lease(std::uint64_t lease) {
  Status first;
  for (CaptureHead& head : heads_) {
    if (Status ended = head.end_lease(lease); !ended && first) first = std::move(ended);
  }
  align_now_ = true;
  return first;
}

Status Capture::start_genlock(const GenlockStart& start, Instant now) {
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
    stop_genlock(now);
    return started;
  }
  mode_ = hal::TriggerMode::kExternal;
  close_all(now);
  restart_clocks(settings.rate, true, now);
  return {};
}

void Capture::stop_genlock(Instant now) {
  genlock_.stop();
  if (mode_ == hal::TriggerMode::kFreeRun) return;
  mode_ = hal::TriggerMode::kFreeRun;
  close_all(now);
  restart_clocks(timing_.configured(), false, now);
}

Outlet<SetLoan>& Capture::add_outlet(const OutletSpec& spec, bool open) {
  report_.outlets.push_back({spec.name, {}});
  return assembly_.add_outlet(spec, open);
}

void Capture::log_to(CaptureLog& log) {
  log_ = &log;
  assembly_.log_to(&log);
}

void Capture::log_changes() {
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    const auto& losses = heads_[i].report().counts.losses;
    for (std::size_t reason = 0; reason < kLossReasons; ++reason) {
      if (std::exchange(logged_.losses[i][reason], losses[reason]) == losses[reason]) continue;
      log_->note(FramesLost{static_cast<HeadIndex>(i), static_cast<LossReason>(reason), losses[reason]});
    }
  }
  if (std::exchange(logged_.genlock, genlock_.state()) != genlock_.state())
    log_->note(GenlockChanged{genlock_.state()});
}

void Capture::release_frames(FrameSet& set, std::uint32_t collection) {
  if (log_) log_->note(SetReturned{set.number, collection});
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (set.has(i)) heads_[i].release(set.frames[i].slot);
  }
  set.mask = 0;
}

void Capture::check() const {
  FrameCounts all;
  for (const CaptureHead& head : heads_) {
    NODAL_ASSERT(head.conserved());
    all.add(head.report().counts);
  }
  NODAL_ASSERT(all.held == assembly_.held() && all.conserved());
}

GenlockReport Capture::genlock_report() const {
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

void Capture::update_report(Instant now, bool changed) {
  if (!changed && now < next_report_) return;
  report_.frames = {};
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (mode_ == hal::TriggerMode::kFreeRun) heads_[i].set_drift(aligner_.drift_ppb(i));
    report_.heads[i] = heads_[i].report();
    report_.frames.add(heads_[i].report().counts);
  }
  std::size_t next_outlet = 0;
  for (const Outlet<SetLoan>& outlet : assembly_.outlets()) report_.outlets[next_outlet++].losses = outlet.losses();
  report_.genlock = genlock_report();
  report_.rate = timing_.rate();
  report_.exposure = exposure_.report();
  if (now >= next_report_ || report_.sets != reported_sets_) {
    snapshot_.publish(report_);
    next_report_ = now + kReportEvery;
    reported_sets_ = report_.sets;
  }
}

}  // namespace nodal::firmware
