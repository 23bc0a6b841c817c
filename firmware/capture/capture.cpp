#include "firmware/capture/capture.h"

#include <algorithm>

#include "firmware/capture/capture_log.h"
#include "firmware/frame/drain.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kCommands = 64;
constexpr Duration kReportEvery = Duration::milliseconds(20);

/// Every head is restored, also after an error of another.
Status end_leases(std::deque<CaptureHead>& heads, std::uint64_t lease) {
  Status first;
  for (CaptureHead& head : heads) {
    if (Status ended = head.end_lease(lease); !ended && first) first = std::move(ended);
  }
  return first;
}

}  // namespace

Capture::Capture(const RigConfig& config, hal::HeadEnumerator& heads, hal::TriggerPort* trigger)
    : exposure_(config.exposure),
      pace_(config, trigger, [this](Instant now) { close_all(now); }),
      assembly_([this](FrameSet& set, std::uint32_t collection) { release_frames(set, collection); }),
      requests_(kCommands),
      answers_(kCommands) {
  for (const HeadConfig& head : config.heads) heads_.emplace_back(head, head.port.text(), heads);
  report_.heads.resize(heads_.size());
}

Capture::~Capture() { close(); }

void Capture::close() {
  close_all(Instant());
  for (Outlet<SetLoan>& outlet : assembly_.outlets()) outlet.drop_waiting();
  assembly_.collect();
  pace_.close();
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
  busy |= pace_.take_edges(now);
  for (CaptureHead& head : heads_) busy |= head.step(now, pace_.mode());
  busy |= take_frames();
  busy |= close_due_sets(now);
  pace_.align(heads_, now);
  busy |= pace_.step(now);
  check();
  if (log_) log_changes();
  update_report(now, busy);
  steps_.fetch_add(1, std::memory_order_relaxed);
  return busy;
}

void Capture::add_wake_ups(hal::WakeUps& to) const {
  for (const CaptureHead& head : heads_) head.add_wake_ups(to);
  pace_.add_wake_ups(to);
  if (!assembly_.empty()) to.at(due());
  to.at(next_report_);
}

bool Capture::run_commands(Instant now) {
  bool any = false;
  for (std::size_t taken = 0; taken < requests_.capacity() && !answers_.full(); ++taken) {
    auto command = requests_.pop();
    if (!command) break;
    any = true;
    if (log_) log_->note(CommandTaken{*command});
    Status status = carry_out(command->what, now);
    if (log_) log_->note(CommandAnswered{command->ticket, status});
    answers_.push(CaptureAnswer{command->ticket, now, std::move(status), pace_.report(), exposure_.report()});
  }
  return any;
}

Status Capture::carry_out(const CaptureCommand& command, Instant now) {
  if (const auto* change = std::get_if<HeadChange>(&command)) return change_heads(*change);
  if (const auto* start = std::get_if<GenlockStart>(&command)) return pace_.start(*start, now);
  if (const auto* end = std::get_if<LeaseEnd>(&command)) {
    pace_.align_soon();
    return end_leases(heads_, end->lease);
  }
  if (const auto* exposing = std::get_if<ExposureChange>(&command)) {
    exposure_.set(exposing->applied_to(exposure_.report().settings));
  } else {
    pace_.stop(now);
  }
  return {};
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
      pace_.align_soon();
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
    pace_.align_soon();
  }
  return {};
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
  const GenlockState genlock = pace_.state();
  if (std::exchange(logged_.genlock, genlock) != genlock) log_->note(GenlockChanged{genlock});
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

void Capture::update_report(Instant now, bool changed) {
  if (!changed && now < next_report_) return;
  report_.frames = {};
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (pace_.mode() == hal::TriggerMode::kFreeRun) heads_[i].set_drift(pace_.free_drift_ppb(i));
    report_.heads[i] = heads_[i].report();
    report_.frames.add(heads_[i].report().counts);
  }
  std::size_t next_outlet = 0;
  for (const Outlet<SetLoan>& outlet : assembly_.outlets()) report_.outlets[next_outlet++].losses = outlet.losses();
  report_.genlock = pace_.report();
  report_.rate = pace_.timing().rate();
  report_.exposure = exposure_.report();
  if (now >= next_report_ || report_.sets != reported_sets_) {
    snapshot_.publish(report_);
    next_report_ = now + kReportEvery;
    reported_sets_ = report_.sets;
  }
}

}  // namespace nodal::firmware
