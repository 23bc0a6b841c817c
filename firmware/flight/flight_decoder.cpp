#include <limits>
#include <utility>

#include "firmware/flight/flight_codec.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

namespace wire = take::flight;

constexpr std::int64_t kLatestNs = std::int64_t{1} << 60;
constexpr std::uint32_t kMaxPixels = 1U << 16;
constexpr int kPixelFormats = static_cast<int>(PixelFormat::kYuv411);
constexpr int kGenlockStates = static_cast<int>(GenlockState::kLost) + 1;
constexpr std::uint8_t kAnyByte = 0;  ///< stands for the pictures, which nothing reads

tl::unexpected<Error> wrong(const char* what) { return fail(Errc::kBadFormat, std::string(what) + " is out of range"); }

Instant at(std::int64_t step_ns, std::int64_t before_ns) {
  return Instant::from_ns(
      static_cast<std::int64_t>(static_cast<std::uint64_t>(step_ns) - static_cast<std::uint64_t>(before_ns)));
}

Error error_of(const wire::Status& from) { return {static_cast<Errc>(from.code()), from.message()}; }
Status status_of(const wire::Status& from) {
  if (from.code() == 0) return {};
  return fail(error_of(from));
}

WhiteBalance balance_of(std::uint32_t in_one) {
  return {static_cast<std::uint16_t>(in_one >> 16), static_cast<std::uint16_t>(in_one & 0xFFFF)};
}

Result<HeadIndex> head_of(std::uint32_t head) {
  if (head >= kMaxHeads) return wrong("the head");
  return static_cast<HeadIndex>(head);
}

bool is_picture(std::uint32_t format, std::uint32_t width, std::uint32_t height, std::uint32_t fields) {
  return format >= 1 && format <= kPixelFormats && width <= kMaxPixels && height <= kMaxPixels &&
         fields <= static_cast<std::uint32_t>(Fields::kBottomOnly);
}

Result<CaptureEvent> opened(const wire::Opened& from) {
  NODAL_TRY_ASSIGN(const auto head, head_of(from.head()));
  HeadOpened event;
  event.head = head;
  event.status = status_of(from.status());
  if (!event.status) return event;
  event.identity = {from.path(), from.serial(), from.model()};
  if (!is_picture(from.format(), from.width(), from.height(), from.fields())) return wrong("the format of the head");
  const auto rate = FrameRate::make(from.rate_numerator(), from.rate_denominator());
  if (!rate) return wrong("the rate of the head");
  event.format = {static_cast<PixelFormat>(from.format()), static_cast<int>(from.width()),
                  static_cast<int>(from.height()), static_cast<Fields>(from.fields()), *rate};
  hal::HeadLimits& limits = event.limits;
  limits.exposure_min = Exposure::of(Duration::nanoseconds(from.exposure_min_ns()));
  limits.exposure_max = Exposure::of(Duration::nanoseconds(from.exposure_max_ns()));
  limits.gain_min = Gain::millidecibels(from.gain_min_mdb());
  limits.gain_max = Gain::millidecibels(from.gain_max_mdb());
  limits.gamma_min = hal::Gamma::thousandths(from.gamma_min());
  limits.gamma_max = hal::Gamma::thousandths(from.gamma_max());
  limits.has_white_balance = from.white_balance();
  limits.has_trigger_input = from.trigger_input();
  limits.control_latency_frames = from.control_latency_frames();
  limits.nudge = {Duration::nanoseconds(from.nudge_step_ns()), Duration::nanoseconds(from.nudge_shortest_ns()),
                  Duration::nanoseconds(from.nudge_longest_ns()), from.nudge_latency_frames()};
  return event;
}

Result<CaptureEvent> called(const wire::Called& from) {
  NODAL_TRY_ASSIGN(const auto head, head_of(from.head()));
  if (from.call() >= HeadCalled::kCalls) return wrong("the call");
  return HeadCalled{head, static_cast<HeadCalled::Call>(from.call()), from.value(), status_of(from.status())};
}

Result<CaptureEvent> trigger_started(const wire::TriggerStarted& from) {
  TriggerStarted event;
  event.settings.rate = {from.rate_numerator(), from.rate_denominator()};
  if (!event.settings.rate.valid()) return wrong("the rate of the trigger");
  if (from.delay_ns_size() != kMaxHeads) return wrong("the number of delays of the trigger");
  event.settings.follow = from.follow();
  event.settings.pulse_width = Duration::nanoseconds(from.pulse_width_ns());
  event.settings.active_high = from.active_high();
  for (int i = 0; i < kMaxHeads; ++i)
    event.settings.delay[static_cast<std::size_t>(i)] = Duration::nanoseconds(from.delay_ns(i));
  event.status = status_of(from.status());
  return event;
}

Result<CaptureEvent> light(const wire::Light& from) {
  LightTaken event;
  event.light.set = from.set();
  event.light.light = from.light();
  event.light.solid_angle = from.solid_angle();
  if (from.heads_size() > kMaxHeads) return wrong("the number of heads of the light");
  for (int i = 0; i < from.heads_size(); ++i) {
    const wire::Light::Head& head = from.heads(i);
    event.light.heads[static_cast<std::size_t>(i)] = {head.exposure(), head.light(), head.solid_angle(),
                                                      head.clipped(),  head.black(), head.overlaps()};
  }
  return event;
}

Result<CaptureCommand> change_of(const wire::Command& from) {
  if (from.has_heads()) {
    const wire::Command::Heads& heads = from.heads();
    HeadChange change;
    change.heads = heads.mask();
    change.lease = heads.lease();
    if (heads.has_exposure_ns()) change.change.exposure = Exposure::of(Duration::nanoseconds(heads.exposure_ns()));
    if (heads.has_gain_mdb()) change.change.gain = Gain::millidecibels(heads.gain_mdb());
    if (heads.has_white_balance()) change.change.white_balance = balance_of(heads.white_balance());
    if (heads.has_gamma()) change.change.gamma = hal::Gamma::thousandths(heads.gamma());
    return change;
  }
  if (from.has_genlock_start()) {
    GenlockStart start;
    if (from.genlock_start().rate_numerator() != 0) {
      start.rate = FrameRate{from.genlock_start().rate_numerator(), from.genlock_start().rate_denominator()};
      if (!start.rate->valid()) return wrong("the rate of the command");
    }
    if (from.genlock_start().has_pulse_width_ns())
      start.pulse_width = Duration::nanoseconds(from.genlock_start().pulse_width_ns());
    return start;
  }
  if (from.has_program()) {
    const wire::Command::Program& program = from.program();
    ExposureChange change;
    if (program.program() > static_cast<std::uint32_t>(ExposureProgram::kJoint)) return wrong("the exposure program");
    if (program.has_program()) change.program = static_cast<ExposureProgram>(program.program());
    if (program.anchor() < -1 || program.anchor() >= kMaxHeads) return wrong("the anchor");
    if (program.has_anchor()) {
      change.anchor.emplace();
      if (program.anchor() >= 0) *change.anchor = static_cast<HeadIndex>(program.anchor());
    }
    if (program.has_target()) change.target = program.target();
    if (program.has_difference()) change.difference = program.difference();
    if (program.has_ramp()) change.ramp = program.ramp();
    if (program.has_longest_ns()) change.longest = Exposure::of(Duration::nanoseconds(program.longest_ns()));
    if (program.has_highest_mdb()) change.highest = Gain::millidecibels(program.highest_mdb());
    if (program.has_locked()) change.locked = program.locked();
    return change;
  }
  if (from.genlock_stop()) return GenlockStop{};
  if (from.lease_end() != 0) return LeaseEnd{from.lease_end()};
  return wrong("the command");
}

Result<CaptureEvent> set_closed(const wire::SetClosed& from, std::int64_t step_ns) {
  SetClosed event;
  event.number = from.number();
  event.mid_exposure = at(step_ns, from.mid_exposure_ns());
  event.mask = from.mask();
  if (from.genlock() >= kGenlockStates) return wrong("the state of the genlock");
  event.sync.state = static_cast<GenlockState>(from.genlock());
  if (from.has_pulse()) event.sync.trigger = from.pulse();
  event.sync.spread = Duration::nanoseconds(from.spread_ns());
  if (from.has_begin_spread_ns()) event.sync.begin_spread = Duration::nanoseconds(from.begin_spread_ns());
  if (from.has_drift_ppb()) event.sync.drift_ppb = from.drift_ppb();
  int next = 0;
  for (std::size_t i = 0; i < event.sync.offset.size(); ++i) {
    if ((event.mask & head_bit(i)) == 0) continue;
    if (next == from.offset_ns_size()) return wrong("the number of offsets of the set");
    event.sync.offset[i] = Duration::nanoseconds(from.offset_ns(next++));
  }
  return event;
}

}  // namespace

Result<CaptureEvent> FlightDecoder::delivered(const wire::Delivered& from) {
  NODAL_TRY_ASSIGN(const auto index, head_of(from.head()));
  Head& head = heads_[index];
  if (from.has_settings()) {
    const wire::Settings& settings = from.settings();
    head.settings.exposure = Exposure::of(Duration::nanoseconds(settings.exposure_ns()));
    head.settings.gain = Gain::millidecibels(settings.gain_mdb());
    if (settings.red_q12() > UINT16_MAX || settings.blue_q12() > UINT16_MAX) return wrong("the white balance");
    head.settings.white_balance = {static_cast<std::uint16_t>(settings.red_q12()),
                                   static_cast<std::uint16_t>(settings.blue_q12())};
    head.settings.gamma = hal::Gamma::thousandths(settings.gamma());
  }
  if (from.has_picture()) {
    const wire::Picture& picture = from.picture();
    if (!is_picture(picture.format(), picture.width(), picture.height(), picture.fields())) return wrong("the picture");
    head.picture = {static_cast<PixelFormat>(picture.format()), static_cast<int>(picture.width()),
                    static_cast<int>(picture.height()), picture.present(), static_cast<Fields>(picture.fields())};
  }
  if (!head.picture) return fail(Errc::kBadFormat, "the first frame of a head has no picture");
  if (from.slot() > std::numeric_limits<hal::BufferSlot>::max()) return wrong("the slot");
  if (from.verdict() > static_cast<std::uint32_t>(hal::FrameVerdict::kNoSignal)) return wrong("the verdict");
  HeadDelivered event;
  event.head = index;
  event.frame.slot = static_cast<hal::BufferSlot>(from.slot());
  event.frame.sequence = from.sequence();
  event.frame.mid_exposure = at(step_ns_, from.mid_exposure_ns());
  event.frame.received = at(step_ns_, from.received_ns());
  event.frame.in_effect = head.settings;
  event.frame.nudged = Duration::nanoseconds(from.nudged_ns());
  event.frame.verdict = static_cast<hal::FrameVerdict>(from.verdict());
  event.frame.fields = head.picture->fields;
  event.frame.image.format = head.picture->format;
  event.frame.image.width = head.picture->width;
  event.frame.image.height = head.picture->height;
  if (head.picture->present) event.frame.image.planes[0].data = &kAnyByte;
  return event;
}

Result<CaptureEvent> FlightDecoder::decode(const wire::Event& from) {
  switch (from.what_case()) {
    case wire::Event::kStepNs:
      if (from.step_ns() < 0 || from.step_ns() > kLatestNs - step_ns_) return wrong("the time of a step");
      step_ns_ += from.step_ns();
      return StepBegun{Instant::from_ns(step_ns_)};
    case wire::Event::kOpened: return opened(from.opened());
    case wire::Event::kCalled: return called(from.called());
    case wire::Event::kDelivered: return delivered(from.delivered());
    case wire::Event::kHeadFailed: {
      NODAL_TRY_ASSIGN(const auto head, head_of(from.head_failed().head()));
      return HeadFailed{head, error_of(from.head_failed().status())};
    }
    case wire::Event::kTriggerStarted: return trigger_started(from.trigger_started());
    case wire::Event::kTriggerStopped: return TriggerStopped{};
    case wire::Event::kPulse: return PulseSeen{{from.pulse().number(), at(step_ns_, from.pulse().at_ns())}};
    case wire::Event::kTriggerFailed: return TriggerFailed{error_of(from.trigger_failed())};
    case wire::Event::kLight: return light(from.light());
    case wire::Event::kCommand: {
      NODAL_TRY_ASSIGN(auto change, change_of(from.command()));
      return CommandTaken{{from.command().ticket(), std::move(change)}};
    }
    case wire::Event::kAnswer: return CommandAnswered{from.answer().ticket(), status_of(from.answer().status())};
    case wire::Event::kSetClosed: return set_closed(from.set_closed(), step_ns_);
    case wire::Event::kSetReturned: return SetReturned{from.set_returned().number(), from.set_returned().collection()};
    case wire::Event::kLost: {
      NODAL_TRY_ASSIGN(const auto head, head_of(from.lost().head()));
      if (from.lost().reason() >= kLossReasons) return wrong("the reason of a loss");
      return FramesLost{head, static_cast<LossReason>(from.lost().reason()), from.lost().count()};
    }
    case wire::Event::kGenlock:
      if (from.genlock() >= kGenlockStates) return wrong("the state of the genlock");
      return GenlockChanged{static_cast<GenlockState>(from.genlock())};
    case wire::Event::WHAT_NOT_SET: break;
  }
  return fail(Errc::kBadFormat, "an event of an unknown kind");
}

}  // namespace nodal::firmware
