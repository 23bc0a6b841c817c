#include "firmware/status.h"

#include "protocol/upload.h"

namespace nodal::firmware {

void add_count(google::protobuf::RepeatedPtrField<wire::Count>& into, std::string_view reason, std::uint64_t count) {
  if (count == 0) return;
  wire::Count& added = *into.Add();
  added.set_reason(std::string(reason));
  added.set_frames(count);
}

namespace {

void fill_losses(const FrameCounts& counts, google::protobuf::RepeatedPtrField<wire::Count>& into) {
  for (std::size_t i = 0; i < kLossReasons; ++i) {
    add_count(into, loss_reason_name(static_cast<LossReason>(i)), counts.losses[i]);
  }
}

std::uint64_t ns_of(Duration duration) { return static_cast<std::uint64_t>(duration.ns()); }

}  // namespace

wire::Error to_wire(const Error& error) {
  wire::Error message;
  message.set_code(static_cast<std::uint32_t>(error.code));
  message.set_message(error.message);
  return message;
}

void fill_genlock(const GenlockReport& genlock, wire::Genlock& into) {
  into.set_state(std::string(genlock_state_name(genlock.state)));
  into.set_rate_numerator(genlock.rate.numerator);
  into.set_rate_denominator(genlock.rate.denominator);
  into.set_triggers(genlock.triggers);
  into.set_missing_triggers(genlock.missing);
  into.set_spread_ns(ns_of(genlock.spread));
  into.set_spread_worst_ns(ns_of(genlock.spread_worst));
  into.set_losses(genlock.losses);
  into.set_holdovers(genlock.holdovers);
  if (genlock.drift_ppb) into.set_drift_ppb(*genlock.drift_ppb);
}

void fill_heads(const RigConfig& config, const CaptureReport& capture, wire::Heads& into) {
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    const HeadReport& head = capture.heads[i];
    wire::HeadState& state = *into.add_heads();
    state.set_index(static_cast<std::uint32_t>(i));
    state.set_name(config.heads[i].name);
    state.set_path(head.path);
    state.set_model(head.model);
    state.set_serial(head.serial);
    state.set_present(head.present);
    if (head.format) {
      state.set_format(std::string(pixel_format_name(head.format->pixels)) + " " + std::to_string(head.format->width) +
                       "x" + std::to_string(head.format->height));
    }
    state.set_exposure_ns(ns_of(head.in_effect.exposure.duration()));
    state.set_gain_mdb(head.in_effect.gain.mdb());
    state.set_red_q12(head.in_effect.white_balance.red_q12);
    state.set_blue_q12(head.in_effect.white_balance.blue_q12);
    state.set_gamma(static_cast<std::uint32_t>(head.in_effect.gamma.thousandths()));
    state.set_frames(head.counts.frames);
    fill_losses(head.counts, *state.mutable_losses());
    state.set_skew_ns(head.skew.ns());
    state.set_problem(head.problem.empty() ? head.ignores : head.problem);
    state.set_missing_sets(head.missing_sets);
    state.set_opened(head.opened);
    if (!head.limits) continue;
    state.set_exposure_min_ns(ns_of(head.limits->exposure_min.duration()));
    state.set_exposure_max_ns(ns_of(head.limits->exposure_max.duration()));
    state.set_gain_min_mdb(head.limits->gain_min.mdb());
    state.set_gain_max_mdb(head.limits->gain_max.mdb());
  }
}

void fill_capture(const CaptureReport& capture, wire::RigStatus& into) {
  into.set_sets(capture.sets);
  into.set_full_sets(capture.full_sets);
  into.set_frames_taken(capture.frames.frames);
  into.set_frames_in_sets(capture.frames.in_sets);
  into.set_frames_held(capture.frames.held);
  fill_losses(capture.frames, *into.mutable_losses());
  fill_genlock(capture.genlock, *into.mutable_genlock());
}

void fill_sync(const RaymapInfo& info, wire::RaymapHeader& into) {
  const SyncEvidence& sync = info.sync;
  into.set_genlock(std::string(genlock_state_name(sync.state)));
  if (sync.trigger) into.set_trigger(*sync.trigger);
  into.set_spread_ns(ns_of(sync.spread));
  if (sync.begin_spread) into.set_begin_spread_ns(ns_of(*sync.begin_spread));
  if (sync.drift_ppb) into.set_drift_ppb(*sync.drift_ppb);
  for (std::size_t i = 0; i < sync.offset.size() && (info.heads >> i) != 0; ++i) {
    into.add_offset_ns(sync.offset[i].ns());
  }
}

void fill_calibrations(const KeeperAnswer::Listed& listed, wire::Calibrations& into) {
  for (const CalibrationStore::Entry& entry : listed.entries) {
    wire::CalibrationEntry& added = *into.add_entries();
    added.set_id(sha256_to_wire(entry.id));
    added.set_name(entry.name);
    added.set_heads(static_cast<std::uint32_t>(entry.heads));
    added.set_generation(entry.generation);
    added.set_in_force(listed.in_force == entry.id);
  }
}

}  // namespace nodal::firmware
