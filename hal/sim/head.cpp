#include "hal/sim/head.h"

#include <algorithm>
#include <utility>

#include "hal/sim/crystal.h"
#include "hal/sim/head_port.h"

namespace nodal::hal::sim {

namespace {

/// The most free-run exposures that one step catches up on; far more than a head has buffers.
constexpr std::uint64_t kExposuresAStep = 64;

}  // namespace

SensorOptions sensor_options(const HeadOptions& options) {
  return {options.pixels == PixelFormat::kMjpeg ? PixelFormat::kI420 : options.pixels,
          options.fields != Fields::kProgressive,
          options.rate.period() / 2,
          options.reference,
          options.supersampling,
          options.noise};
}

HeadLimits default_head_limits() {
  HeadLimits limits;
  limits.exposure_min = Exposure::microseconds(10);
  limits.exposure_max = Exposure::microseconds(33'000);
  limits.gain_min = Gain::millidecibels(0);
  limits.gain_max = Gain::millidecibels(24'000);
  limits.gamma_min = Gamma::thousandths(1000);
  limits.gamma_max = Gamma::thousandths(3000);
  limits.has_white_balance = true;
  limits.has_trigger_input = true;
  limits.control_latency_frames = 2;
  limits.nudge = {Duration::microseconds(25), Duration::milliseconds(-2), Duration::milliseconds(4), 2};
  return limits;
}

SimHead::SimHead(ClockPort& clock, SimTrigger& trigger, ScenePtr scene, const HeadCalibration& truth,
                 const HeadOptions& options, std::uint64_t seed)
    : clock_(clock),
      trigger_(trigger),
      scene_(std::move(scene)),
      truth_(truth),
      options_(options),
      identity_{"sim:" + truth.name, "sim-" + truth.name, "Nodal simulated head"},
      format_{options.pixels, truth.width, truth.height, options.fields, options.rate},
      random_(seed, identity_.path),
      seed_(random_.next()),
      sensor_(std::make_unique<Sensor>(truth, sensor_options(options), scene_, seed_)),
      settings_(options.settings),
      in_effect_(options.settings) {
  NODAL_ASSERT(options.buffers >= 1);
  if (options.pixels == PixelFormat::kMjpeg) jpeg_camera_ = std::make_unique<JpegCamera>();
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
  keep_sequence_ = !streaming_;
}

void SimHead::prepare() { sensor_->prepare(); }

void SimHead::unplug() {
  if (!present_) return;
  if (streaming_) step(clock_.now());
  present_ = false;
  streaming_ = false;
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
  settings_ = in_effect_ = options_.settings;  // it was without power and lost its settings
  changes_.clear();
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
  if (streaming_) return fail(Errc::kWrongState, "head '" + identity_.path + "': is started already; stop it first");
  if (mode == TriggerMode::kExternal && !options_.limits.has_trigger_input) {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': has no trigger input; start it in free run");
  }
  const Instant now = clock_.now();
  trigger_.step(now);  // pulses from before the start do not belong to this stream
  mode_ = mode;
  streaming_ = true;
  if (!keep_sequence_) sequence_ = 0;
  keep_sequence_ = false;
  busy_until_ = last_received_ = now;
  free_run_next_ = 0;
  nudges_.restart();
  const Duration period = options_.rate.period();
  const Duration drawn =
      Duration::nanoseconds(static_cast<std::int64_t>(random_.below(static_cast<std::uint64_t>(period.ns()))));
  free_run_from_ = now + options_.free_run_phase.value_or(drawn);
  return {};
}

void SimHead::stop() {
  if (!streaming_) return;
  step(clock_.now());
  streaming_ = false;
  discard_waiting();
  const std::size_t untaken = port_->take_back();
  counts_.discarded += untaken;
  counts_.waiting -= untaken;
  // Written registers keep their values, and no delayed setting waits for a frame.
  if (!stuck_) in_effect_ = settings_;
  changes_.clear();
}

void SimHead::discard_waiting() {
  counts_.discarded += exposed_.size();
  counts_.waiting -= exposed_.size();
  exposed_.clear();
}

void SimHead::change(const HeadSettings& wanted) {
  if (streaming_) step(clock_.now());
  settings_ = wanted;
  if (stuck_) return;
  if (!streaming_) {
    in_effect_ = wanted;
    return;
  }
  const int latency = options_.limits.control_latency_frames;
  // The newest of several changes between two exposures replaces the others, so an untriggered head keeps only one.
  if (!changes_.empty() && changes_.back().frames_left == latency) changes_.pop_back();
  changes_.push_back({wanted, latency});
}

Status SimHead::nudge(Duration by) {
  const NudgeLimits& limits = options_.limits.nudge;
  if (!limits.possible() || (by < Duration() ? limits.shortest : limits.longest) == Duration()) {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': its exposures cannot be moved that way in time");
  }
  if (!streaming_ || mode_ != TriggerMode::kFreeRun) {
    return fail(Errc::kWrongState, "head '" + identity_.path + "': nudge() when it does not run free");
  }
  step(clock_.now());
  if (!stuck_) nudges_.ask(by, limits);
  return {};
}

void SimHead::step(Instant now) {
  trigger_.step(now);
  if (streaming_ && mode_ != TriggerMode::kExternal) run_free_until(now);
  deliver_until(now);
}

std::optional<Instant> SimHead::next_arrival() const {
  if (!streaming_) return std::nullopt;
  if (!exposed_.empty()) return exposed_.front().received;
  std::optional<Instant> begin;
  if (mode_ != TriggerMode::kExternal) begin = free_run_begin();
  if (mode_ != TriggerMode::kFreeRun) {
    if (const auto pulse = trigger_.next_pulse()) begin = std::min(begin.value_or(*pulse), *pulse);
  }
  if (!begin) return std::nullopt;
  Duration exposure = in_effect_.exposure.duration();
  for (const Pending& change : changes_) exposure = std::min(exposure, change.settings.exposure.duration());
  const Duration second_field = options_.fields == Fields::kProgressive ? Duration() : options_.rate.period() / 2;
  return *begin + second_field + exposure + options_.readout;
}

/// Exposes by the head's own clock.
void SimHead::run_free_until(Instant now) {
  std::uint64_t done = 0;
  for (Instant begin = free_run_begin(); begin <= now; begin = free_run_begin()) {
    if (done++ == kExposuresAStep && skip_to(now)) continue;
    ++free_run_next_;
    deliver_until(begin);
    expose(begin, std::nullopt);
    nudges_.next_period(options_.limits.nudge, begin + options_.rate.period() - busy_until_);
  }
}

Instant SimHead::free_run_begin() const {
  return free_run_from_ + stretched(options_.rate.start_of(free_run_next_), free_run_drift_ppb()) + nudges_.done();
}

/// After a long pause, makes only the oldest and the newest kExposuresAStep frames one by one, to bound a step's time.
bool SimHead::skip_to(Instant now) {
  const Duration elapsed = unstretched(now - free_run_from_ - nudges_.done(), free_run_drift_ppb());
  const std::uint64_t due = options_.rate.first_after(elapsed);
  if (due <= free_run_next_ + kExposuresAStep) return false;
  const std::uint64_t unseen = due - kExposuresAStep - free_run_next_;
  free_run_next_ += unseen;
  lose_unseen(unseen);
  return true;
}

void SimHead::on_unseen(std::uint64_t pulses) {
  if (streaming_ && mode_ == TriggerMode::kExternal) lose_unseen(pulses);
}

/// Loses `frames` frames because every buffer is full; the device's own counter advances.
void SimHead::lose_unseen(std::uint64_t frames) {
  sequence_ += static_cast<std::uint32_t>(frames);
  counts_.exposed += frames;
  counts_.without_buffer += frames;
}

void SimHead::on_pulse(std::uint64_t number, Instant at) {
  if (!streaming_ || mode_ == TriggerMode::kFreeRun) return;
  const bool wired = mode_ == TriggerMode::kWired;
  if (wired) {
    if (!cable_ || number % static_cast<std::uint64_t>(pulses_an_exposure_) != 0) return;
    run_free_until(at);
  }
  deliver_until(std::min(at, clock_.now()));  // a delayed pulse is in the future
  const Instant begin = at + options_.trigger_latency + random_.around_zero(options_.trigger_jitter);
  if (wired) {
    // Its own clock continues only when the next pulse is an eighth of a period late.
    free_run_from_ = begin + options_.rate.period() * pulses_an_exposure_ + options_.rate.period() / 8;
    free_run_next_ = 0;
  }
  expose(begin, number);
}

Fields SimHead::fields_that_come() {
  Fields fields = options_.fields;
  if (std::exchange(swap_fields_next_, false)) {
    fields = fields == Fields::kTopFirst ? Fields::kBottomFirst : Fields::kTopFirst;
  }
  if (std::exchange(lose_field_next_, false)) {
    fields = fields == Fields::kTopFirst ? Fields::kTopOnly : Fields::kBottomOnly;
  }
  return fields;
}

void SimHead::expose(Instant begin, std::optional<std::uint64_t> pulse) {
  if (begin < busy_until_) {
    ++counts_.pulses_ignored;
    return;
  }
  while (!changes_.empty() && changes_.front().frames_left == 0) {
    in_effect_ = changes_.front().settings;
    changes_.pop_front();
  }
  for (Pending& change : changes_) --change.frames_left;

  Exposed frame;
  frame.sequence = sequence_++;
  frame.settings = in_effect_;
  frame.nudged = nudges_.done();
  frame.said_mid = begin + in_effect_.exposure.duration() / 2 + random_.around_zero(options_.stamp_jitter);
  const Duration exposure = in_effect_.exposure.duration();
  frame.begin = begin;
  frame.mid = begin + exposure / 2;
  frame.light = light_;
  const bool interlaced = options_.fields != Fields::kProgressive;
  if (interlaced) frame.fields = fields_that_come();
  const Duration second_field = interlaced ? options_.rate.period() / 2 : Duration();
  busy_until_ = begin + std::max(second_field + exposure, options_.readout);
  newest_[frame.sequence % newest_.size()] = {frame.sequence, pulse, begin, frame.mid};
  ++counts_.exposed;

  const HeadFaults& faults = options_.faults;
  if (lose_ > 0 || random_.chance(faults.lose)) {
    if (lose_ > 0) --lose_;
    ++counts_.by_fault;
    return;
  }
  Duration late = delay_next_;
  delay_next_ = {};
  if (random_.chance(faults.delay) && faults.longest_delay.ns() > 0) {
    late = late + Duration::nanoseconds(
                      static_cast<std::int64_t>(random_.below(static_cast<std::uint64_t>(faults.longest_delay.ns()))));
  }
  frame.received = last_received_ = std::max(last_received_, begin + second_field + exposure + options_.readout + late);
  if (!signal_) {
    frame.verdict = FrameVerdict::kNoSignal;
  } else if (tear_next_ || random_.chance(faults.tear)) {
    frame.verdict = FrameVerdict::kTorn;
    tear_next_ = false;
  } else if (corrupt_next_ || random_.chance(faults.corrupt)) {
    frame.verdict = FrameVerdict::kCorrupt;
    corrupt_next_ = false;
  }
  frame.spoiled = std::exchange(spoil_next_, false);
  exposed_.push_back(frame);
  ++counts_.waiting;
  if (duplicate_next_ || random_.chance(faults.duplicate)) {
    duplicate_next_ = false;
    exposed_.push_back(frame);
    ++counts_.waiting;
    ++counts_.duplicated;
  }
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

FrameView SimHead::picture(const Exposed& frame, Rendering& rendering) {
  std::vector<std::uint8_t>& bytes = rendering.bytes;
  FrameView view;
  view.sequence = frame.sequence;
  view.mid_exposure = frame.said_mid;
  view.received = frame.received;
  view.in_effect = frame.settings;
  view.nudged = frame.nudged;
  view.verdict = frame.verdict;
  view.fields = frame.fields;
  if (frame.verdict == FrameVerdict::kNoSignal) {
    std::fill(bytes.begin(), bytes.end(), std::uint8_t{128});
    rendering.holds = 0;
  } else {
    sensor_->set_light(frame.light);
    rendering.holds = sensor_->render(frame.settings, frame.mid, frame.sequence, bytes, rendering.holds, frame.fields);
  }
  std::vector<std::uint8_t>* delivered = &bytes;
  if (jpeg_camera_) {
    delivered = &rendering.jpeg;
    const ImageView picture =
        packed_image(PixelFormat::kI420, truth_.width, truth_.height, std::as_const(bytes).data());
    jpeg_camera_->encode(picture, rendering.jpeg);
    const auto length = static_cast<int>(rendering.jpeg.size());
    view.image = {PixelFormat::kMjpeg, truth_.width, truth_.height, {}, rendering.jpeg.size()};
    view.image.planes[0] = {rendering.jpeg.data(), length, 1, length, 1};
  } else {
    view.image = packed_image(options_.pixels, truth_.width, truth_.height, std::as_const(bytes).data());
  }
  if (frame.verdict == FrameVerdict::kTorn) {
    // The transfer ended early: the rest of the buffer keeps its old content, here nothing.
    view.image.bytes = delivered->size() / 2;
    std::fill(delivered->begin() + static_cast<std::ptrdiff_t>(view.image.bytes), delivered->end(), std::uint8_t{0});
    rendering.holds = 0;
  }
  if (frame.verdict == FrameVerdict::kCorrupt || frame.spoiled) {
    Random garbage(seed_ + frame.sequence, "garbage");
    for (std::size_t i = delivered->size() / 3; i < delivered->size() / 3 * 2; ++i) {
      (*delivered)[i] = static_cast<std::uint8_t>(garbage.next());
    }
    rendering.holds = 0;
  }
  return view;
}

}  // namespace nodal::hal::sim
