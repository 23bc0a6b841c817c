#include <algorithm>

#include "firmware/flight/flight_codec.h"

namespace nodal::firmware {
namespace {

namespace wire = take::flight;

constexpr std::size_t kMaxMessageBytes = 1024;  ///< so that a record is not larger than a frame

/// The difference of two times, which may be any, because heads may report any.
std::int64_t before(std::int64_t step_ns, Instant at) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(step_ns) - static_cast<std::uint64_t>(at.ns()));
}

void put(const Error& error, wire::Status& to) {
  to.set_code(static_cast<std::uint32_t>(error.code));
  to.set_message(error.message.substr(0, kMaxMessageBytes));
}

/// Success is the empty message, which is left out.
template <class To>
void put(const Status& status, To& to) {
  if (!status) put(status.error(), *to.mutable_status());
}

std::uint32_t in_one(WhiteBalance balance) { return std::uint32_t{balance.red_q12} << 16 | balance.blue_q12; }

void put(const HeadOpened& event, wire::Opened& to) {
  to.set_head(event.head);
  put(event.status, to);
  if (!event.status) return;
  to.set_path(event.identity.path);
  to.set_serial(event.identity.serial);
  to.set_model(event.identity.model);
  to.set_format(static_cast<std::uint32_t>(event.format.pixels));
  to.set_width(static_cast<std::uint32_t>(event.format.width));
  to.set_height(static_cast<std::uint32_t>(event.format.height));
  to.set_fields(static_cast<std::uint32_t>(event.format.fields));
  to.set_rate_numerator(event.format.rate.numerator);
  to.set_rate_denominator(event.format.rate.denominator);
  const hal::HeadLimits& limits = event.limits;
  to.set_exposure_min_ns(limits.exposure_min.duration().ns());
  to.set_exposure_max_ns(limits.exposure_max.duration().ns());
  to.set_gain_min_mdb(limits.gain_min.mdb());
  to.set_gain_max_mdb(limits.gain_max.mdb());
  to.set_gamma_min(limits.gamma_min.thousandths());
  to.set_gamma_max(limits.gamma_max.thousandths());
  to.set_white_balance(limits.has_white_balance);
  to.set_trigger_input(limits.has_trigger_input);
  to.set_control_latency_frames(limits.control_latency_frames);
  to.set_nudge_step_ns(limits.nudge.step.ns());
  to.set_nudge_shortest_ns(limits.nudge.shortest.ns());
  to.set_nudge_longest_ns(limits.nudge.longest.ns());
  to.set_nudge_latency_frames(limits.nudge.latency_frames);
}

void put(const TriggerStarted& event, wire::TriggerStarted& to) {
  to.set_rate_numerator(event.settings.rate.numerator);
  to.set_rate_denominator(event.settings.rate.denominator);
  to.set_follow(event.settings.follow);
  to.set_pulse_width_ns(event.settings.pulse_width.ns());
  to.set_active_high(event.settings.active_high);
  for (const Duration delay : event.settings.delay) to.add_delay_ns(delay.ns());
  put(event.status, to);
}

void put(const blend::SphereLight& light, wire::Light& to) {
  to.set_set(light.set);
  to.set_light(light.light);
  to.set_solid_angle(light.solid_angle);
  std::size_t heads = light.heads.size();
  while (heads > 0 && light.heads[heads - 1].solid_angle == 0) --heads;
  for (std::size_t i = 0; i < heads; ++i) {
    const blend::HeadLight& head = light.heads[i];
    wire::Light::Head& put = *to.add_heads();
    put.set_exposure(head.exposure);
    put.set_light(head.light);
    put.set_solid_angle(head.solid_angle);
    put.set_clipped(head.clipped);
    put.set_black(head.black);
    put.set_overlaps(head.overlaps);
  }
}

void put(const HeadChange& change, wire::Command::Heads& to) {
  to.set_mask(change.heads);
  to.set_lease(change.lease);
  if (change.change.exposure) to.set_exposure_ns(change.change.exposure->duration().ns());
  if (change.change.gain) to.set_gain_mdb(change.change.gain->mdb());
  if (change.change.white_balance) to.set_white_balance(in_one(*change.change.white_balance));
  if (change.change.gamma) to.set_gamma(change.change.gamma->thousandths());
}

void put(const ExposureChange& change, wire::Command::Program& to) {
  if (change.program) to.set_program(static_cast<std::uint32_t>(*change.program));
  if (change.anchor) to.set_anchor(*change.anchor ? std::int32_t{**change.anchor} : -1);
  if (change.target) to.set_target(*change.target);
  if (change.difference) to.set_difference(*change.difference);
  if (change.ramp) to.set_ramp(*change.ramp);
  if (change.longest) to.set_longest_ns(change.longest->duration().ns());
  if (change.highest) to.set_highest_mdb(change.highest->mdb());
  if (change.locked) to.set_locked(*change.locked);
}

void put(const CaptureRequest& command, wire::Command& to) {
  to.set_ticket(command.ticket);
  if (const auto* heads = std::get_if<HeadChange>(&command.what)) {
    put(*heads, *to.mutable_heads());
  } else if (const auto* start = std::get_if<GenlockStart>(&command.what)) {
    wire::Command::GenlockStart& put = *to.mutable_genlock_start();
    if (start->rate) put.set_rate_numerator(start->rate->numerator), put.set_rate_denominator(start->rate->denominator);
    if (start->pulse_width) put.set_pulse_width_ns(start->pulse_width->ns());
  } else if (const auto* program = std::get_if<ExposureChange>(&command.what)) {
    put(*program, *to.mutable_program());
  } else if (const auto* end = std::get_if<LeaseEnd>(&command.what)) {
    to.set_lease_end(end->lease);
  } else {
    to.set_genlock_stop(true);
  }
}

void put(const SetClosed& event, std::int64_t step_ns, wire::SetClosed& to) {
  to.set_number(event.number);
  to.set_mid_exposure_ns(before(step_ns, event.mid_exposure));
  to.set_mask(event.mask);
  to.set_genlock(static_cast<std::uint32_t>(event.sync.state));
  if (event.sync.trigger) to.set_pulse(*event.sync.trigger);
  to.set_spread_ns(event.sync.spread.ns());
  if (event.sync.begin_spread) to.set_begin_spread_ns(event.sync.begin_spread->ns());
  if (event.sync.drift_ppb) to.set_drift_ppb(*event.sync.drift_ppb);
  for (std::size_t i = 0; i < event.sync.offset.size(); ++i) {
    if ((event.mask & head_bit(i)) != 0) to.add_offset_ns(event.sync.offset[i].ns());
  }
}

template <class... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};
template <class... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

}  // namespace

void FlightEncoder::encode(const HeadDelivered& event, wire::Delivered& to) {
  const hal::FrameView& frame = event.frame;
  Head& head = heads_[event.head];
  to.set_head(event.head);
  to.set_slot(frame.slot);
  to.set_sequence(frame.sequence);
  to.set_mid_exposure_ns(before(step_ns_, frame.mid_exposure));
  to.set_received_ns(before(step_ns_, frame.received));
  to.set_nudged_ns(frame.nudged.ns());
  to.set_verdict(static_cast<std::uint32_t>(frame.verdict));
  const Picture picture{frame.image.format, frame.image.width, frame.image.height,
                        frame.image.planes[0].data != nullptr, frame.fields};
  if (!head.picture || head.settings != frame.in_effect) {
    wire::Settings& settings = *to.mutable_settings();
    settings.set_exposure_ns(frame.in_effect.exposure.duration().ns());
    settings.set_gain_mdb(frame.in_effect.gain.mdb());
    settings.set_red_q12(frame.in_effect.white_balance.red_q12);
    settings.set_blue_q12(frame.in_effect.white_balance.blue_q12);
    settings.set_gamma(frame.in_effect.gamma.thousandths());
    head.settings = frame.in_effect;
  }
  if (head.picture != picture) {
    wire::Picture& put = *to.mutable_picture();
    put.set_format(static_cast<std::uint32_t>(picture.format));
    put.set_width(static_cast<std::uint32_t>(picture.width));
    put.set_height(static_cast<std::uint32_t>(picture.height));
    put.set_present(picture.present);
    put.set_fields(static_cast<std::uint32_t>(picture.fields));
    head.picture = picture;
  }
}

void FlightEncoder::encode(const CaptureEvent& event, wire::Event& to) {
  std::visit(Overloaded{
                 [&](const StepBegun& e) {
                   to.set_step_ns(before(e.now.ns(), Instant::from_ns(step_ns_)));
                   step_ns_ = e.now.ns();
                 },
                 [&](const HeadOpened& e) { put(e, *to.mutable_opened()); },
                 [&](const HeadCalled& e) {
                   wire::Called& called = *to.mutable_called();
                   called.set_head(e.head);
                   called.set_call(static_cast<std::uint32_t>(e.call));
                   called.set_value(e.value);
                   put(e.status, called);
                 },
                 [&](const HeadDelivered& e) { encode(e, *to.mutable_delivered()); },
                 [&](const HeadFailed& e) {
                   to.mutable_head_failed()->set_head(e.head);
                   put(e.error, *to.mutable_head_failed()->mutable_status());
                 },
                 [&](const TriggerStarted& e) { put(e, *to.mutable_trigger_started()); },
                 [&](const TriggerStopped&) { to.set_trigger_stopped(true); },
                 [&](const PulseSeen& e) {
                   to.mutable_pulse()->set_number(e.edge.number);
                   to.mutable_pulse()->set_at_ns(before(step_ns_, e.edge.at));
                 },
                 [&](const TriggerFailed& e) { put(e.error, *to.mutable_trigger_failed()); },
                 [&](const LightTaken& e) { put(e.light, *to.mutable_light()); },
                 [&](const CommandTaken& e) { put(e.command, *to.mutable_command()); },
                 [&](const CommandAnswered& e) {
                   to.mutable_answer()->set_ticket(e.ticket);
                   put(e.status, *to.mutable_answer());
                 },
                 [&](const SetClosed& e) { put(e, step_ns_, *to.mutable_set_closed()); },
                 [&](const SetReturned& e) {
                   to.mutable_set_returned()->set_number(e.number);
                   to.mutable_set_returned()->set_collection(e.collection);
                 },
                 [&](const FramesLost& e) {
                   to.mutable_lost()->set_head(e.head);
                   to.mutable_lost()->set_reason(static_cast<std::uint32_t>(e.reason));
                   to.mutable_lost()->set_count(e.count);
                 },
                 [&](const GenlockChanged& e) { to.set_genlock(static_cast<std::uint32_t>(e.state)); },
             },
             event);
}

}  // namespace nodal::firmware
