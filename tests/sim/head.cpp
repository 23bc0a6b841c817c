#include "tests/sim/head.h"

#include <algorithm>

namespace nodal::swarm {
namespace {

/// One JPEG in this many is cut off. Drivers do not look into JPEGs, so its verdict is good.
constexpr std::uint64_t kCutEvery = 50;

}  // namespace

/// The open head. After unplugging the port keeps existing; the head owns the buffers, so lent pictures stay readable.
class Head::Port final : public hal::HeadPort {
 public:
  explicit Port(Head& head) : head_(&head), kept_(head) {}
  ~Port() override {
    stop();
    if (head_) head_->port_ = nullptr;
  }
  void vanish() { head_ = nullptr; }

  const hal::HeadIdentity& identity() const override { return kept_.identity_; }
  const hal::HeadFormat& format() const override { return kept_.format_; }
  const hal::HeadLimits& limits() const override { return kept_.limits_; }
  Status start(hal::TriggerMode mode) override { return head_ ? head_->start(mode) : Status(fail(gone())); }
  void stop() override {
    if (head_) head_->stop();
  }
  Status set_exposure(Exposure exposure) override {
    return set(exposure >= kept_.limits_.exposure_min && exposure <= kept_.limits_.exposure_max,
               [&](hal::HeadSettings& wanted) { wanted.exposure = exposure; });
  }
  Status set_gain(Gain gain) override {
    return set(gain >= kept_.limits_.gain_min && gain <= kept_.limits_.gain_max,
               [&](hal::HeadSettings& wanted) { wanted.gain = gain; });
  }
  Status set_white_balance(WhiteBalance balance) override {
    return set(true, [&](hal::HeadSettings& wanted) { wanted.white_balance = balance; });
  }
  Status set_gamma(hal::Gamma gamma) override {
    if (gamma == hal::Gamma()) return head_ ? Status() : fail(gone());  // the head's default curve
    return fail(Errc::kUnsupported, identity().path + ": has no gamma to set");
  }
  Status nudge(Duration by) override { return head_ ? head_->nudge(by) : fail(gone()); }
  Result<std::optional<hal::FrameView>> take_frame() override {
    if (!head_) return fail(gone());
    if (!head_->streaming_) return fail(Errc::kWrongState, identity().path + ": take_frame() before start()");
    if (head_->filled_.empty()) return std::optional<hal::FrameView>{};
    const hal::BufferSlot slot = head_->filled_.front();
    head_->filled_.pop_front();
    head_->buffers_[slot].state = Buffer::State::kLent;
    ++head_->counts_.taken;
    return std::optional<hal::FrameView>{head_->view(slot)};
  }
  void add_wake_ups(hal::WakeUps&) const override {}  // the swarm's events decide when the rig steps
  void release(hal::BufferSlot slot) override {
    if (!head_ || slot >= head_->buffers_.size()) return;
    Buffer& buffer = head_->buffers_[slot];
    if (buffer.state == Buffer::State::kLent) buffer.state = Buffer::State::kFree;
  }

 private:
  Error gone() const { return {Errc::kDeviceGone, "head '" + identity().path + "': unplugged; plug it in again"}; }
  template <class Change>
  Status set(bool allowed, Change&& change) {
    if (!head_) return fail(gone());
    if (!allowed) return fail(Errc::kBadValue, identity().path + ": outside its limits");
    hal::HeadSettings wanted = head_->asked_;
    change(wanted);
    head_->change(wanted);
    return {};
  }

  Head* head_;  ///< null once unplugged
  const Head& kept_;
};

Head::Head(std::uint8_t index, hal::sim::SimClock& clock, EventQueue& queue, const HeadNature& nature,
           std::uint64_t seed)
    : clock_(clock),
      queue_(queue),
      nature_(nature),
      identity_{"sim:cam" + std::to_string(index), "swarm-" + std::to_string(index), "Nodal swarm head"},
      random_(seed, identity_.path),
      index_(index),
      buffers_(static_cast<std::size_t>(nature.buffers)) {
  for (Buffer& buffer : buffers_) buffer.picture = grey_picture(nature.pixels, nature.coding);
  format_.pixels = nature.pixels;
  format_.width = kPictureWidth;
  format_.height = kPictureHeight;
  format_.rate = nature.rate;
  format_.fields = nature.fields;
  limits_.exposure_min = Exposure::microseconds(10);
  limits_.exposure_max =
      Exposure::of((interlaced() ? nature.rate.period() / 2 : nature.rate.period()) - nature.readout / 8);
  limits_.gain_max = Gain::millidecibels(24'000);
  limits_.has_white_balance = true;
  limits_.has_trigger_input = true;
  limits_.control_latency_frames = nature.control_latency;
  limits_.nudge = nature.nudge;
  asked_.exposure = in_effect_.exposure = Exposure::of(nature.rate.period() / 4);
}

Head::~Head() { NODAL_ASSERT(port_ == nullptr); }

bool Head::take_one(int& count) { return count > 0 && count-- > 0; }

void Head::delay(int frames, Duration by) {
  late_ += frames;
  late_by_ = by;
}

void Head::stall(Duration how_long) { stalled_until_ = clock_.now() + how_long; }

void Head::set_deaf(bool deaf) {
  if (deaf_ == deaf) return;
  deaf_ = deaf;
  if (!streaming_ || mode_ != hal::TriggerMode::kExternal) return;
  ++epoch_;
  if (deaf) run_free(std::max(last_begin_ + nature_.rate.period(), clock_.now()));
}

void Head::shift(Duration by) {
  for (Instant* moment : {&started_, &free_run_from_, &last_begin_, &busy_until_, &last_received_, &stalled_until_}) {
    *moment = *moment + by;
  }
  for (Frame& frame : exposed_) frame.received = frame.received + by;
}

void Head::unplug() {
  if (!present_) return;
  present_ = false;
  streaming_ = false;
  ++epoch_;
  discard();
  if (port_) port_->vanish();
  port_ = nullptr;
}

void Head::forget_faults() {
  lose_ = corrupt_ = tear_ = duplicate_ = resize_ = late_ = miss_ = 0;
  signal_ = true;
  stuck_ = half_rate_ = false;
  set_deaf(false);
  clock_error_ = {};
  stalled_until_ = Instant();
  storm_ = {};
  present_ = true;
}

Result<std::unique_ptr<hal::HeadPort>> Head::open() {
  if (!present_) return fail(Errc::kNoSuchDevice, "head '" + identity_.path + "': is not plugged in");
  if (port_) return fail(Errc::kBusy, "head '" + identity_.path + "': is open already");
  for (Buffer& buffer : buffers_) buffer.state = Buffer::State::kFree;
  asked_ = {};
  asked_.exposure = Exposure::of(nature_.rate.period() / 4);
  in_effect_ = asked_;
  changes_.clear();
  auto port = std::make_unique<Port>(*this);
  port_ = port.get();
  return port;
}

Status Head::start(hal::TriggerMode mode) {
  if (streaming_) return fail(Errc::kWrongState, identity_.path + ": is started already; stop it first");
  mode_ = mode;
  streaming_ = true;
  ++epoch_;
  sequence_ = 0;
  started_ = busy_until_ = last_received_ = clock_.now();
  const auto period = static_cast<std::uint64_t>(nature_.rate.period().ns());
  const auto phase = Duration::nanoseconds(static_cast<std::int64_t>(random_.below(period)));
  if (mode != hal::TriggerMode::kExternal || deaf_) run_free(started_ + phase);
  return {};
}

void Head::run_free(Instant from) {
  free_run_from_ = from;
  free_run_next_ = 0;
  nudges_.restart();
  queue_.plan(from, EventKind::kExpose, index_, epoch_);
}

void Head::stop() {
  if (!streaming_) return;
  streaming_ = false;
  ++epoch_;
  discard();
  for (Buffer& buffer : buffers_) buffer.state = Buffer::State::kFree;
  in_effect_ = asked_;
  changes_.clear();
}

void Head::discard() {
  counts_.discarded += exposed_.size() + filled_.size();
  exposed_.clear();
  filled_.clear();
}

void Head::change(const hal::HeadSettings& wanted) {
  asked_ = wanted;
  if (stuck_) return;
  if (!streaming_) {
    in_effect_ = wanted;
  } else {
    changes_.push_back({wanted, nature_.control_latency});
  }
}

Status Head::nudge(Duration by) {
  if (!nature_.nudge.possible() || (by < Duration() ? nature_.nudge.shortest : nature_.nudge.longest) == Duration()) {
    return fail(Errc::kUnsupported, identity_.path + ": cannot be moved that way");
  }
  if (!streaming_ || mode_ != hal::TriggerMode::kFreeRun) {
    return fail(Errc::kWrongState, identity_.path + ": does not run free");
  }
  if (!stuck_) nudges_.ask(by, nature_.nudge);
  return {};
}

void Head::on_pulse(PulseId pulse, Instant at) {
  if (!streaming_ || mode_ == hal::TriggerMode::kFreeRun || deaf_) return;
  if (take_one(miss_) || random_.chance(storm_.miss_pulse)) return;
  const Instant begin = at + nature_.latency + nature_.delay + random_.around_zero(nature_.latency_jitter);
  if (mode_ == hal::TriggerMode::kWired) {
    if (half_rate_ && pulse.number % 2 != 0) return;
    // Its own clock continues only when the next pulse is an eighth of a period late.
    ++epoch_;
    run_free(begin + nature_.rate.period() * (half_rate_ ? 2 : 1) + nature_.rate.period() / 8);
  }
  expose(begin, pulse);
}

void Head::on_expose(const Event& event) {
  if (event.epoch != epoch_ || !streaming_) return;
  expose(event.at + random_.around_zero(nature_.latency_jitter), {});
  nudges_.next_period(nature_.nudge, event.at + nature_.rate.period() - nature_.latency_jitter * 2 - busy_until_);
  ++free_run_next_;
  const Duration ideal = nature_.rate.start_of(free_run_next_);
  const Duration drift = Duration::nanoseconds(ideal.us() * nature_.drift_ppm / 1000);
  queue_.plan(std::max(free_run_from_ + ideal + drift + nudges_.done(), event.at), EventKind::kExpose, index_, epoch_);
}

void Head::expose(Instant begin, PulseId pulse) {
  if (begin < busy_until_) return;  // ignores a pulse during an exposure
  while (!changes_.empty() && changes_.front().frames_left == 0) {
    in_effect_ = changes_.front().settings;
    changes_.pop_front();
  }
  for (Pending& change : changes_) --change.frames_left;
  const Duration exposure = in_effect_.exposure.duration();
  const Duration second_field = interlaced() ? nature_.rate.period() / 2 : Duration();
  last_begin_ = begin;
  by_pulse_ = pulse.epoch != 0;
  busy_until_ = begin + std::max(second_field + exposure, nature_.readout);
  ++counts_.exposed;
  ++serial_;
  const std::uint32_t sequence = sequence_++;
  if (take_one(lose_) || random_.chance(storm_.lose)) {
    ++counts_.lost;
    return;
  }
  Frame frame;
  frame.stamp = Stamp{Stamp::kMark, index_, serial_, pulse, begin, begin + exposure / 2, 0};
  frame.sequence = sequence;
  frame.nudged = nudges_.done();
  frame.settings = in_effect_;
  frame.mid = frame.stamp.mid + clock_error_ + random_.around_zero(nature_.clock_jitter);
  Duration late;
  if (take_one(late_)) late = late_by_;
  if (random_.chance(storm_.late)) {
    late = Duration::nanoseconds(
        static_cast<std::int64_t>(random_.below(static_cast<std::uint64_t>(storm_.longest_late.ns()))));
  }
  frame.received = std::max({last_received_, begin + second_field + exposure + nature_.readout + late, stalled_until_});
  last_received_ = frame.received;
  if (!signal_) frame.verdict = hal::FrameVerdict::kNoSignal;
  else if (take_one(tear_) || random_.chance(storm_.tear)) frame.verdict = hal::FrameVerdict::kTorn;
  else if (take_one(corrupt_) || random_.chance(storm_.corrupt)) frame.verdict = hal::FrameVerdict::kCorrupt;
  frame.cut = nature_.pixels == PixelFormat::kMjpeg && frame.stamp.serial % kCutEvery == 0;
  frame.resized = take_one(resize_) || random_.chance(storm_.wrong_size);
  const bool twice = take_one(duplicate_) || random_.chance(storm_.duplicate);
  queue_.plan(frame.received, EventKind::kArrive, index_, epoch_);
  exposed_.push_back(frame);
  if (!twice) return;
  ++counts_.duplicated;
  queue_.plan(frame.received, EventKind::kArrive, index_, epoch_);
  exposed_.push_back(frame);
}

bool Head::on_arrive(const Event& event) {
  // After a stop and a start older events are still queued; frames do not depend on a particular event.
  if (event.epoch != epoch_ && exposed_.empty()) return false;
  bool any = false;
  while (!exposed_.empty() && exposed_.front().received <= event.at) {
    deliver(exposed_.front());
    exposed_.pop_front();
    any = true;
  }
  return any;
}

void Head::deliver(Frame frame) {
  for (std::size_t slot = 0; slot < buffers_.size(); ++slot) {
    Buffer& buffer = buffers_[slot];
    if (buffer.state != Buffer::State::kFree) continue;
    buffer.state = Buffer::State::kFilled;
    frame.stamp.write(writable_view(nature_.pixels, buffer.picture));
    buffer.frame = frame;
    filled_.push_back(static_cast<hal::BufferSlot>(slot));
    return;
  }
  ++counts_.lost;
}

hal::FrameView Head::view(std::size_t slot) const {
  const Frame& frame = buffers_[slot].frame;
  hal::FrameView view;
  view.slot = static_cast<hal::BufferSlot>(slot);
  view.sequence = frame.sequence;
  view.mid_exposure = frame.mid;
  view.received = frame.received;
  view.in_effect = frame.settings;
  view.nudged = frame.nudged;
  view.verdict = frame.verdict;
  view.fields = nature_.fields;
  if (interlaced() && frame.resized) {
    const bool swapped = frame.stamp.serial % 2 == 0;
    view.fields = swapped ? fields_from(other(first_field(nature_.fields))) : Fields::kTopOnly;
  }
  const std::vector<std::uint8_t>& picture = buffers_[slot].picture;
  view.image = picture_view(nature_.pixels, picture);
  view.image.coding = nature_.coding;
  if (frame.resized && !interlaced()) view.image.height /= 2;
  if (frame.cut) view.image.bytes = 1 + frame.stamp.serial * 37 % (picture.size() - 1);
  return view;
}

}  // namespace nodal::swarm
