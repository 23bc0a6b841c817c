#include "hal/sim/head.h"

#include <algorithm>
#include <utility>

#include "hal/sim/head_port.h"

namespace nodal::hal::sim {

namespace {

/// The most free-run exposures that one step catches up on; far more than a head has buffers.
constexpr std::uint64_t kExposuresAStep = 64;

}  // namespace

SimHead::SimHead(ClockPort& clock, SimTrigger& trigger, ScenePtr scene, const HeadCalibration& truth,
                 const HeadOptions& options, std::uint64_t seed)
    : clock_(clock),
      trigger_(trigger),
      options_(options),
      identity_{"sim:" + truth.name, "sim-" + truth.name, "Nodal simulated head"},
      random_(seed, identity_.path),
      picture_(truth, options, std::move(scene), random_.next()),
      settings_(options.settings, options.limits.control_latency_frames),
      free_run_(options.rate, options.free_run_drift_ppm, options.limits.nudge) {
  NODAL_ASSERT(options.buffers >= 1);
  if (options.fields != Fields::kProgressive) {
    const Exposure field = Exposure::of(options.rate.period() / 2);
    options_.limits.exposure_max = std::min(options_.limits.exposure_max, field);
  }
}

SimHead::~SimHead() {
  NODAL_ASSERT(port_ == nullptr);  // ports must be destroyed before their rig
}

void SimHead::set_sequence(std::uint32_t next) {
  sequence_ = next;
  keep_sequence_ = !streaming();
}

void SimHead::unplug() {
  if (!present_) return;
  if (streaming()) step(clock_.now());
  present_ = false;
  mode_.reset();
  discard_waiting();
  if (port_ != nullptr) {
    const std::size_t untaken = port_->vanish();
    counts_.discarded += untaken;
    counts_.waiting -= untaken;
    port_ = nullptr;
  }
}

void SimHead::replug() {
  present_ = true;
  settings_.reset(options_.settings);
}

std::optional<FrameTruth> SimHead::truth_of(std::uint32_t sequence) const {
  const FrameTruth& truth = newest_[sequence % newest_.size()];
  if (counts_.exposed == 0 || truth.sequence != sequence || truth.exposure_begin == Instant{}) return std::nullopt;
  return truth;
}

Result<std::unique_ptr<HeadPort>> SimHead::open() {
  if (!present_) return fail(Errc::kNoSuchDevice, "head '" + identity_.path + "': is not plugged in");
  if (port_ != nullptr) return fail(Errc::kBusy, "head '" + identity_.path + "': is open already");
  auto port = std::make_unique<Port>(*this);
  port_ = port.get();
  return port;
}

Status SimHead::start(TriggerMode mode) {
  if (streaming()) return fail(Errc::kWrongState, "head '" + identity_.path + "': is started already; stop it first");
  if (mode == TriggerMode::kExternal && !options_.limits.has_trigger_input) {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': has no trigger input; start it in free run");
  }
  const Instant now = clock_.now();
  trigger_.step(now);  // pulses from before the start do not belong to this stream
  mode_ = mode;
  if (!keep_sequence_) sequence_ = 0;
  keep_sequence_ = false;
  busy_until_ = last_received_ = now;
  const Duration drawn = random_.below(options_.rate.period());
  free_run_.start(now + options_.free_run_phase.value_or(drawn));
  return {};
}

void SimHead::stop() {
  if (!streaming()) return;
  step(clock_.now());
  mode_.reset();
  discard_waiting();
  const std::size_t untaken = port_->take_back();
  counts_.discarded += untaken;
  counts_.waiting -= untaken;
  settings_.end_stream();
}

void SimHead::discard_waiting() {
  counts_.discarded += exposed_.size();
  counts_.waiting -= exposed_.size();
  exposed_.clear();
}

void SimHead::change(const HeadSettings& wanted) {
  if (streaming()) step(clock_.now());
  settings_.make(wanted, streaming());
}

Status SimHead::nudge(Duration by) {
  const NudgeLimits& limits = options_.limits.nudge;
  if (!limits.possible() || (by < Duration() ? limits.shortest : limits.longest) == Duration()) {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': its exposures cannot be moved that way in time");
  }
  if (mode_ != TriggerMode::kFreeRun) {
    return fail(Errc::kWrongState, "head '" + identity_.path + "': nudge() when it does not run free");
  }
  step(clock_.now());
  if (!settings_.stuck()) free_run_.nudge(by);
  return {};
}

void SimHead::step(Instant now) {
  trigger_.step(now);
  if (streaming() && mode_ != TriggerMode::kExternal) run_free_until(now);
  deliver_until(now);
}

std::optional<Instant> SimHead::next_arrival() const {
  if (!streaming()) return std::nullopt;
  if (!exposed_.empty()) return exposed_.front().received;
  std::optional<Instant> begin;
  if (mode_ != TriggerMode::kExternal) begin = free_run_.next();
  if (mode_ != TriggerMode::kFreeRun) {
    if (const auto pulse = trigger_.next_pulse()) begin = std::min(begin.value_or(*pulse), *pulse);
  }
  if (!begin) return std::nullopt;
  const Duration second_field = options_.fields == Fields::kProgressive ? Duration() : options_.rate.period() / 2;
  return *begin + second_field + settings_.shortest_exposure() + options_.readout;
}

/// Exposes by the head's own clock. After a long pause, makes only the oldest and the newest kExposuresAStep frames one
/// by one, to bound a step's time.
void SimHead::run_free_until(Instant now) {
  std::uint64_t done = 0;
  for (Instant begin = free_run_.next(); begin <= now; begin = free_run_.next()) {
    if (done++ == kExposuresAStep) {
      if (const std::uint64_t unseen = free_run_.skip(now, kExposuresAStep); unseen > 0) {
        lose_unseen(unseen);
        continue;
      }
    }
    free_run_.advance();
    deliver_until(begin);
    expose(begin, std::nullopt);
    free_run_.move_next(begin, busy_until_);
  }
}

void SimHead::on_unseen(std::uint64_t pulses) {
  if (mode_ == TriggerMode::kExternal) lose_unseen(pulses);
}

/// Loses `frames` frames because every buffer is full; the device's own counter advances.
void SimHead::lose_unseen(std::uint64_t frames) {
  sequence_ += static_cast<std::uint32_t>(frames);
  counts_.exposed += frames;
  counts_.without_buffer += frames;
}

void SimHead::on_pulse(std::uint64_t number, Instant at) {
  if (!streaming() || mode_ == TriggerMode::kFreeRun) return;
  const bool wired = mode_ == TriggerMode::kWired;
  if (wired) {
    if (!cable_.connected || number % static_cast<std::uint64_t>(cable_.pulses_an_exposure) != 0) return;
    run_free_until(at);
  }
  deliver_until(std::min(at, clock_.now()));  // a delayed pulse is in the future
  const Instant begin = at + options_.trigger_latency + random_.around_zero(options_.trigger_jitter);
  if (wired) {
    // Its own clock continues only when the next pulse is an eighth of a period late.
    free_run_.restart(begin + options_.rate.period() * cable_.pulses_an_exposure + options_.rate.period() / 8);
  }
  expose(begin, number);
}

void SimHead::expose(Instant begin, std::optional<std::uint64_t> pulse) {
  if (begin < busy_until_) {
    ++counts_.pulses_ignored;
    return;
  }
  settings_.next_exposure();

  ExposedFrame frame;
  frame.sequence = sequence_++;
  frame.settings = settings_.in_effect();
  frame.nudged = free_run_.nudged();
  const Duration exposure = frame.settings.exposure.duration();
  frame.said_mid = begin + exposure / 2 + random_.around_zero(options_.stamp_jitter);
  frame.mid = begin + exposure / 2;
  frame.light = light_;
  const bool interlaced = options_.fields != Fields::kProgressive;
  if (interlaced) frame.fields = next_fields(options_.fields);
  const Duration second_field = interlaced ? options_.rate.period() / 2 : Duration();
  busy_until_ = begin + std::max(second_field + exposure, options_.readout);
  newest_[frame.sequence % newest_.size()] = {frame.sequence, pulse, begin, frame.mid};
  ++counts_.exposed;

  const Fate fate = next_fate(options_.faults, random_);
  if (fate.lost) {
    ++counts_.by_fault;
    return;
  }
  frame.received = last_received_ =
      std::max(last_received_, begin + second_field + exposure + options_.readout + fate.late);
  frame.verdict = fate.verdict;
  frame.spoiled = fate.spoiled;
  const std::uint64_t copies = fate.twice ? 2 : 1;
  exposed_.insert(exposed_.end(), copies, frame);
  counts_.waiting += copies;
  counts_.duplicated += copies - 1;
}

void SimHead::deliver_until(Instant now) {
  while (!exposed_.empty() && exposed_.front().received <= now) {
    if (!port_->fill(exposed_.front())) {
      --counts_.waiting;
      ++counts_.without_buffer;
    }
    exposed_.pop_front();
  }
}

}  // namespace nodal::hal::sim
