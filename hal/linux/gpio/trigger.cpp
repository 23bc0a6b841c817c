#include "hal/linux/gpio/trigger.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "protocol/base/limits.h"
#include "protocol/base/try.h"

namespace nodal::hal::gpio {
namespace {

constexpr Duration kFirstPulse = Duration::milliseconds(1);  ///< as TriggerPort::start() promises

std::string name_of(const TriggerLines& lines) {
  if (!lines.outputs.empty()) return "trigger '" + lines.outputs.front().line.text() + "': ";
  return "trigger '" + (lines.input ? lines.input->text() : std::string("gpio")) + "': ";
}

}  // namespace

GpioTrigger::GpioTrigger(System& system, TriggerLines lines)
    : system_(system), lines_(std::move(lines)), who_(name_of(lines_)), pulses_(system, outputs_, log_) {}

Result<std::unique_ptr<GpioTrigger>> GpioTrigger::open(System& system, TriggerLines lines) {
  std::unique_ptr<GpioTrigger> trigger(new GpioTrigger(system, std::move(lines)));
  if (const Status claimed = trigger->claim(); !claimed) return fail(claimed.error().in("trigger"));
  if (const Status running = trigger->run(); !running) return fail(running.error().in("trigger"));
  return trigger;
}

GpioTrigger::~GpioTrigger() { runner_.reset(); }

Status GpioTrigger::claim() {
  const EdgeKind active = lines_.active_high ? EdgeKind::kRising : EdgeKind::kFalling;
  const auto claim_in = [&](const std::optional<LineName>& name, Bias bias,
                            std::optional<EventReader>& into) -> Status {
    if (!name) return {};
    Claim claimed = system_.claim_input(*name, {false, bias, active});
    if (!claimed.line) return fail(explain_claim(system_, *name, claimed.error));
    into.emplace(system_, *name, std::move(claimed.line));
    return {};
  };
  for (const TriggerLines::Output& output : lines_.outputs) {
    NODAL_TRY_ASSIGN(auto line, claim_output(system_, output.line, !lines_.active_high));
    outputs_.push_back(std::move(line));
  }
  NODAL_TRY(claim_in(lines_.read_back, Bias::kAsIs, read_back_line_));
  return claim_in(lines_.input, lines_.input_bias, input_);
}

Status GpioTrigger::run() {
  if (outputs_.empty()) return {};
  try {
    Running running = system_.run({"nodal-trigger", true}, [this](Instant now) { return step(now); });
    runner_ = std::move(running.runner);
    notice_ = std::move(running.notice);
  } catch (const std::system_error& error) {
    return fail(Errc::kOverload, std::string("the system refuses its thread: ") + error.code().message() +
                                     "; raise the limit on processes (ulimit -u, TasksMax=)");
  }
  return {};
}

Status GpioTrigger::check_present() const {
  if (safe_.load()) return fail(Errc::kDeviceGone, who_ + "its lines are safe for good; the program ends");
  const int error = pulses_.counts().error.load();
  if (error == 0 || error == ECANCELED || pulses_.counts().error_train.load() != id_) return {};
  return fail(explain_use(lines_.outputs[pulses_.counts().error_line.load()].line, "writing", error).in("trigger"));
}

Status GpioTrigger::check(const TriggerSettings& settings) const {
  if (safe_.load()) return check_present();
  if (!settings.rate.valid()) {
    return fail(Errc::kBadValue, fmt::format("{}a rate of {}/{} cannot be made; allowed is {}", who_,
                                             settings.rate.numerator, settings.rate.denominator, kFrameRatesAllowed));
  }
  if (settings.follow && !input_) {
    return fail(Errc::kUnsupported,
                who_ + "rig.toml names no input line to follow; set [trigger] source = \"external\"");
  }
  if (!settings.follow && outputs_.empty()) {
    return fail(Errc::kUnsupported,
                who_ + "the line is an input and cannot send pulses; set [trigger] source = \"own\"");
  }
  if (settings.active_high != lines_.active_high) {
    return fail(Errc::kUnsupported, who_ + "the polarity is fixed while nodald runs; set it in rig.toml");
  }
  const Duration period = settings.rate.period();
  if (settings.pulse_width.ns() <= 0 || settings.pulse_width > period - PulseTrain::kGap) {
    return fail(Errc::kBadValue, fmt::format("{}a pulse of {} us does not fit a period of {} us; between two pulses, "
                                             "the line is inactive for at least {} us",
                                             who_, settings.pulse_width.us(), period.us(), PulseTrain::kGap.us()));
  }
  return check_delays(settings);
}

Status GpioTrigger::check_delays(const TriggerSettings& settings) const {
  const Duration period = settings.rate.period();
  for (std::size_t head = 0; head < settings.delay.size(); ++head) {
    if (settings.delay[head].ns() >= 0 && settings.delay[head] < period) continue;
    return fail(Errc::kBadValue, fmt::format("{}the delay of head {} is not between 0 and the period of {} us", who_,
                                             head, period.us()));
  }
  for (const TriggerLines::Output& output : lines_.outputs) {
    for (const HeadIndex head : output.heads) {
      const HeadIndex first = output.heads.front();
      if (settings.delay[head] == settings.delay[first]) continue;
      return fail(Errc::kBadValue, fmt::format("{}heads {} and {} share line {}, but their delays are {} and {} us; "
                                               "give one of them a line of its own (trigger in its [[heads]] entry)",
                                               who_, first, head, output.line.text(), settings.delay[first].us(),
                                               settings.delay[head].us()));
    }
  }
  return {};
}

void GpioTrigger::post(Train train) {
  if (!runner_) return;
  {
    const std::lock_guard lock(mutex_);
    posted_train_ = std::move(train);
    posted_.store(true);
  }
  runner_->ring();
}

Instant GpioTrigger::step(Instant now) {
  if (posted_.load()) {
    Train train;
    {
      const std::lock_guard lock(mutex_);
      train = posted_train_;
      posted_.store(false);
    }
    pulses_.begin(train);
  }
  return pulses_.step(now);
}

Status GpioTrigger::start(const TriggerSettings& settings) {
  NODAL_TRY(check(settings));
  for (std::optional<EventReader>* line : {&input_, &read_back_line_}) {  // edges from before the start
    if (*line) NODAL_TRY((*line)->discard());
  }
  const Instant now = system_.now();
  ++id_;
  running_ = true;
  following_ = settings.follow;
  read_back_.start(settings.rate.period());
  Train train;
  train.active_high = lines_.active_high;
  if (following_) {
    sync_.start(settings.rate, now + kFirstPulse);
    post(std::move(train));
    return {};
  }
  train.id = id_;
  train.rate = settings.rate;
  train.width = settings.pulse_width;
  train.started = now + kFirstPulse;
  for (const TriggerLines::Output& output : lines_.outputs) {
    train.delay.push_back(output.heads.empty() ? Duration() : settings.delay[output.heads.front()]);
  }
  // With a read-back line, the pulses of the line that it is wired to are reported.
  const auto shortest = std::min_element(train.delay.begin(), train.delay.end());
  train.reference = read_back_line_ ? 0 : static_cast<std::size_t>(shortest - train.delay.begin());
  read_back_delay_ = train.delay.front();
  post(std::move(train));
  return {};
}

void GpioTrigger::stop() {
  if (!running_) return;
  running_ = false;
  ++id_;
  Train none;
  none.active_high = lines_.active_high;
  post(std::move(none));
}

void GpioTrigger::add_wake_ups(WakeUps& to) const {
  if (!running_) return;
  const std::optional<EventReader>& line = following_ ? input_ : read_back_line_;
  if (line) to.on({line->descriptor(), true, false});
}

Result<std::optional<TriggerEdge>> GpioTrigger::take_edge() {
  if (safe_.load()) return fail(check_present().error());
  if (!running_) return std::optional<TriggerEdge>{};
  return following_ ? take_followed() : take_sent();
}

Result<std::optional<TriggerEdge>> GpioTrigger::take_followed() {
  for (;;) {
    NODAL_TRY_ASSIGN(const auto event, input_->next());
    if (!event) return std::optional<TriggerEdge>{};
    if (auto pulse = sync_.add(event->at, event->after_gap)) return pulse;
  }
}

Result<std::optional<TriggerEdge>> GpioTrigger::take_sent() {
  NODAL_TRY(check_present());
  if (!read_back_line_) return log_.take(id_);
  while (const auto sent = log_.take(id_)) read_back_.add_pulse(*sent);
  for (;;) {
    NODAL_TRY_ASSIGN(const auto event, read_back_line_->next());
    if (!event) break;
    read_back_.add_edge(event->at - read_back_delay_);
  }
  return read_back_.take(system_.now());
}

TriggerCounts GpioTrigger::counts() const {
  TriggerCounts counts = sync_.counts();
  counts.late = pulses_.counts().late.load();
  counts.refused = pulses_.counts().refused.load();
  counts.unseen = read_back_.unseen();
  counts.doubled += read_back_.extra();
  return counts;
}

void GpioTrigger::make_safe() noexcept {
  safe_.store(true);
  for (const auto& output : outputs_) output->make_safe();
}

}  // namespace nodal::hal::gpio
