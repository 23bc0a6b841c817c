#include "firmware/hosts/status.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/hosts/publisher.h"
#include "firmware/operate/health.h"
#include "protocol/base/text.h"
#include "protocol/upload.h"
#include "protocol/wire_error.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kLongestSoftware = 60;  ///< bytes of a host's software name

}  // namespace

void fill_hosts(const Clients& clients, const Client& asking, Instant now, wire::Hosts& into) {
  const auto since = [&](Instant then) { return static_cast<std::uint64_t>((now - then).ns()); };
  for (const auto& client : clients) {
    if (client->ending()) continue;
    wire::HostState& host = *into.add_hosts();
    host.set_number(client->number());
    host.set_peer(client->peer());
    if (client->said_hello())
      host.set_software(printable(client->session().peer_hello()->software(), kLongestSoftware));
    host.set_connected_ns(since(client->activity().since()));
    host.set_idle_ns(since(client->activity().idle_since()));
    for (const auto& [stream, pull] : client->pulls) {
      const bool jpeg = pull.coding == wire::PullRequest::JPEG;
      const bool raw = pull.coding == wire::PullRequest::RAW;
      std::string what = std::string("pulls ") +
                         (jpeg  ? "jpeg"
                          : raw ? "raw"
                                : "evidence") +
                         (pull.lossless ? " lossless" : "");
      const auto counts = client->session().counts(stream);
      if (pull.lossless && counts && counts->pending > 1) what += fmt::format(", {} behind", counts->pending);
      host.add_streams(std::move(what));
    }
    if (client->lossless_ended > 0) {
      host.add_streams(fmt::format("was too slow for {} lossless pull{}", client->lossless_ended,
                                   client->lossless_ended > 1 ? "s" : ""));
    }
    if (client->frame_set) host.add_streams("pulls a frame set");
    for (std::size_t i = 0; i < client->uploads.size(); ++i) host.add_streams("uploads");
    host.set_bytes_in(client->activity().bytes_in());
    host.set_bytes_out(client->activity().bytes_out());
    host.set_dropped(Publisher::dropped(*client));
    host.set_asking(client.get() == &asking);
  }
}

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

/// Empty when there was nothing to mend.
std::string mended(const hal::HeadRecoveries& recoveries) {
  std::string text;
  if (recoveries.restarts > 0) {
    text = fmt::format("its stream broke and was started again, {} times so far", recoveries.restarts);
  }
  if (recoveries.refused_buffers > 0) {
    text += fmt::format("{}its driver refused buffers and was given them again, {} times so far",
                        text.empty() ? "" : "; ", recoveries.refused_buffers);
  }
  return text;
}

std::string problem_of(const HeadReport& head) {
  if (!head.problem.empty()) return head.problem;
  return head.ignores.empty() ? mended(head.recoveries) : head.ignores;
}

/// The words of rig.toml's trigger_mode, and "free".
const char* name_of(hal::TriggerMode mode) {
  switch (mode) {
    case hal::TriggerMode::kFreeRun: return "free";
    case hal::TriggerMode::kExternal: return "input";
    case hal::TriggerMode::kWired: return "wired";
  }
  return "";
}

std::string ppm_of(std::int32_t ppb) {
  const std::int32_t ppm = (ppb + (ppb < 0 ? -500 : 500)) / 1000;
  return fmt::format("{}{} ppm", ppm < 0 ? "" : "+", ppm);
}

std::uint64_t ns_of(Duration duration) { return static_cast<std::uint64_t>(duration.ns()); }

}  // namespace

std::string shown(std::string_view text) {
  constexpr std::size_t kLongest = 1000;  // bytes; the rest is cut off
  return printable(text, kLongest);
}

void fill_pulse_losses(const hal::TriggerCounts& counts, wire::Genlock& into) {
  for (const auto& [reason, pulses] :
       {std::pair{"late", counts.late}, std::pair{"refused", counts.refused}, std::pair{"unseen", counts.unseen},
        std::pair{"lost", counts.lost}, std::pair{"overrun", counts.overrun}, std::pair{"doubled", counts.doubled},
        std::pair{"jumped", counts.jumps}}) {
    if (pulses == 0) continue;
    wire::PulseCount& count = *into.add_pulse_losses();
    count.set_reason(reason);
    count.set_pulses(pulses);
  }
}

void fill_genlock(const RigConfig& config, const GenlockReport& genlock, wire::Genlock& into) {
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
  into.set_aligned(genlock.aligned);
  fill_pulse_losses(genlock.losses_of_port, into);
  for (std::size_t i = 0; i < config.heads.size(); ++i) {
    const std::string head = "head '" + config.heads[i].name + "' ";
    if (genlock.wired[i].state == Following::kDrifts) {
      into.add_unaligned(head + "does not follow the trigger: its exposures drift by " +
                         ppm_of(genlock.wired[i].drift_ppb) + " against the pulses; check its sync cable and its rate");
    } else if (genlock.wired[i].state == Following::kSkipsPulses) {
      into.add_unaligned(head +
                         "does not follow every trigger: its frames are of every second pulse or fewer; check "
                         "its rate and its exposure");
    }
    if ((genlock.fixed & head_bit(i)) != 0) {
      into.add_unaligned(head + "cannot shift its exposures; it runs on its own clock");
    } else if ((genlock.unresponsive & head_bit(i)) != 0) {
      into.add_unaligned(head + "is asked to shift its exposures and does not");
    } else if ((genlock.one_way & head_bit(i)) != 0) {
      into.add_unaligned(head + "exposes later than the others and can only be delayed");
    }
  }
}

void fill_exposure(const ExposureControl::Report& exposure, std::size_t heads, wire::ExposureState& into) {
  const auto thousandths = [](Stops stops) { return stops * 1000 / kStop; };
  const ExposureSettings& settings = exposure.settings;
  wire::ExposureRequest& in_effect = *into.mutable_settings();
  in_effect.set_program(std::string(exposure_program_name(settings.program)));
  in_effect.set_anchor(settings.anchor ? std::int32_t{*settings.anchor} : -1);
  in_effect.set_target_below(static_cast<std::uint32_t>(thousandths(-settings.target)));
  in_effect.set_difference(static_cast<std::uint32_t>(thousandths(settings.difference)));
  in_effect.set_ramp(static_cast<std::uint32_t>(thousandths(settings.ramp)));
  in_effect.set_longest_ns(ns_of(settings.longest.duration()));
  in_effect.set_highest_gain_mdb(settings.highest.mdb());
  in_effect.set_locked(settings.locked);
  into.set_settled(exposure.settled);
  into.set_sets(exposure.sets);
  into.set_set(exposure.seen.set);
  into.set_light(thousandths(exposure.seen.light));
  const auto ppm = [](std::uint32_t part, std::uint64_t whole) {
    return whole == 0 ? 0U : static_cast<std::uint32_t>(std::uint64_t{part} * 1'000'000 / whole);
  };
  into.set_sphere_ppm(ppm(exposure.seen.solid_angle, 1 << 24));
  for (std::size_t i = 0; i < heads; ++i) {
    const blend::HeadLight& seen = exposure.seen.heads[i];
    wire::HeadExposure& head = *into.add_heads();
    head.set_index(static_cast<std::uint32_t>(i));
    head.set_metered(seen.solid_angle > 0);
    if (!head.metered()) continue;
    head.set_exposure(thousandths(seen.exposure));
    head.set_goal(thousandths(exposure.goal[i]));
    head.set_light(thousandths(seen.light));
    head.set_clipped_ppm(ppm(seen.clipped, seen.solid_angle));
    head.set_black_ppm(ppm(seen.black, seen.solid_angle));
  }
}

void fill_heads(const RigConfig& config, const CaptureReport& capture, const Blender& blender, wire::Heads& into) {
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    const HeadReport& head = capture.heads[i];
    wire::HeadState& state = *into.add_heads();
    state.set_index(static_cast<std::uint32_t>(i));
    state.set_name(config.heads[i].name);
    state.set_path(shown(head.path));
    state.set_model(shown(head.model));
    state.set_serial(shown(head.serial));
    state.set_present(head.present);
    if (head.format) {
      state.set_format(
          fmt::format("{} {}x{}", pixel_format_name(head.format->pixels), head.format->width, head.format->height));
    }
    if (head.started_by) state.set_trigger(name_of(*head.started_by));
    state.set_exposure_ns(ns_of(head.in_effect.exposure.duration()));
    state.set_gain_mdb(head.in_effect.gain.mdb());
    state.set_red_q12(head.in_effect.white_balance.red_q12);
    state.set_blue_q12(head.in_effect.white_balance.blue_q12);
    state.set_gamma(static_cast<std::uint32_t>(head.in_effect.gamma.thousandths()));
    state.set_frames(head.counts.frames);
    fill_losses(head.counts, *state.mutable_losses());
    state.set_skew_ns(head.skew.ns());
    std::string problem = problem_of(head);
    if (problem.empty()) problem = undecodable_now(blender, i);
    state.set_problem(shown(problem));
    state.set_undecodable(blender.undecodable(i).frames.load(std::memory_order_relaxed));
    state.set_missing_sets(head.missing_sets);
    state.set_opened(head.opened);
    if (head.drift_ppb) state.set_drift_ppb(*head.drift_ppb);
    if (!head.limits) continue;
    state.set_exposure_min_ns(ns_of(head.limits->exposure_min.duration()));
    state.set_exposure_max_ns(ns_of(head.limits->exposure_max.duration()));
    state.set_gain_min_mdb(head.limits->gain_min.mdb());
    state.set_gain_max_mdb(head.limits->gain_max.mdb());
  }
}

void fill_capture(const RigConfig& config, const CaptureReport& capture, wire::RigStatus& into) {
  into.set_sets(capture.sets);
  into.set_full_sets(capture.full_sets);
  into.set_frames_taken(capture.frames.frames);
  into.set_frames_in_sets(capture.frames.in_sets);
  into.set_frames_held(capture.frames.held);
  fill_losses(capture.frames, *into.mutable_losses());
  fill_genlock(config, capture.genlock, *into.mutable_genlock());
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

void fill_calibrations(const CalibrationAnswer::Listed& listed, wire::Calibrations& into) {
  const auto add = [&](const CalibrationStore::Entry& entry) -> wire::CalibrationEntry& {
    wire::CalibrationEntry& added = *into.add_entries();
    added.set_id(sha256_to_wire(entry.id));
    added.set_name(shown(entry.name));
    added.set_heads(static_cast<std::uint32_t>(entry.heads));
    added.set_generation(entry.generation);
    added.set_in_force(listed.in_force == entry.id);
    return added;
  };
  if (listed.signed_generation) into.set_signed_generation(*listed.signed_generation);
  if (listed.on_trial) add(*listed.on_trial).set_on_trial(true);
  for (const CalibrationStore::Entry& entry : listed.entries) {
    if (!listed.on_trial || entry.id != listed.on_trial->id) add(entry);
  }
}

void fill_takes(const TakeAnswer::Listed& listed, wire::Takes& into) {
  for (const TakeEntry& entry : listed.takes) {
    wire::TakeEntry& take = *into.add_takes();
    take.set_number(entry.number);
    take.set_state(std::string(take_state_name(entry.state)));
    take.set_started_utc_ns(entry.started_utc_ns);
    take.set_sets(entry.sets);
    take.set_lost_sets(entry.lost_sets);
    take.set_deleted_sets(entry.deleted_sets);
    take.set_lost_by_errors(entry.gaps.error);
    take.set_not_captured(entry.gaps.capture);
    take.set_gaps(entry.gaps.count);
    take.set_longest_gap_ns(ns_of(entry.gaps.longest));
    if (entry.rate) {
      take.set_rate_numerator(entry.rate->numerator);
      take.set_rate_denominator(entry.rate->denominator);
      take.set_rates(static_cast<std::uint32_t>(entry.rates));
    }
    const bool missing = std::ranges::any_of(entry.heads, [](const take::HeadGaps& head) { return head.sum() != 0; });
    for (const take::HeadGaps& head : missing ? entry.heads : std::vector<take::HeadGaps>())
      take.add_missing_pictures(head.sum());
    take.set_bytes(entry.bytes);
    take.set_length_ns(static_cast<std::uint64_t>(entry.length.ns()));
    take.set_is_protected(entry.is_protected);
    // Together TakeShelf::kMaxTakes of them fit one reply: a take that is complete has no problem.
    take.set_ended(printable(entry.ended, 96));
    take.set_problem(printable(entry.problem, 160));
    take.set_width(static_cast<std::uint32_t>(entry.raymap_width));
    take.set_height(static_cast<std::uint32_t>(entry.raymap_height));
  }
}

void fill_disk_test(const TakeAnswer::DiskTested& tested, wire::DiskTested& into) {
  into.set_bytes(tested.speed.bytes);
  into.set_took_ns(static_cast<std::uint64_t>(tested.speed.took.ns()));
  into.set_worst_sync_ns(static_cast<std::uint64_t>(tested.speed.worst_sync.ns()));
  into.set_bytes_a_second(tested.speed.bytes_a_second());
  for (const DiskVerdict& verdict : tested.modes) {
    wire::DiskMode& mode = *into.add_modes();
    mode.set_mode(verdict.mode);
    mode.set_bytes_a_second(verdict.bytes_a_second);
    mode.set_sustained(verdict.sustained);
    mode.set_why(verdict.why);
  }
}

void fill_recording(const TakeReport& takes, Instant now, wire::Recording& into) {
  if (takes.recording) {
    into.set_take(*takes.recording);
    into.set_length_ns(static_cast<std::uint64_t>(std::max(now - takes.since, Duration()).ns()));
    if (takes.durable) into.set_durable_ns(static_cast<std::uint64_t>(std::max(now - *takes.durable, Duration()).ns()));
  }
  into.set_sets(takes.sets);
  into.set_lost_sets(takes.lost_sets);
  into.set_lost_by_errors(takes.lost_by_errors);
  into.set_lost_raymaps(takes.lost_raymaps);
  into.set_buffer_percent(takes.buffer_percent);
  into.set_quality(static_cast<std::uint32_t>(takes.quality));
  into.set_leaves_out_raymaps(takes.leaves_out_raymaps);
  into.set_free_bytes(takes.free_bytes);
  into.set_total_bytes(takes.total_bytes);
  into.set_bytes_a_second(takes.bytes_a_second);
  const std::string& no_disk = takes.no_disk.empty() ? takes.refused : takes.no_disk;
  into.set_problem(shown(takes.problem.empty() ? no_disk : takes.problem));
  into.set_loop(takes.loop);
  into.set_ejected(takes.ejected);
  if (takes.test_percent) into.set_disk_test_percent(*takes.test_percent);
  into.set_deleted_segments(takes.deleted_segments);
}

void fill_audit(const AuditLog& log, const wire::AuditLogRequest& wanted, Instant start, Instant now,
                std::int64_t utc_ns, wire::AuditLog& into) {
  into.set_now_ns(static_cast<std::uint64_t>((now - start).ns()));
  into.set_now_utc_ns(utc_ns);
  into.set_newest(log.newest());
  into.set_oldest(log.oldest());
  into.set_head(sha256_to_wire(log.head()));
  into.set_problem(shown(log.problem()));
  for (const std::string& finding : log.findings()) into.add_findings(shown(finding));
  const std::vector<AuditEntry> entries = log.entries(wanted.after(), wanted.since_utc_ns());
  // Without a start the newest, as before; with one the oldest, and the host asks for more.
  const bool paged = wanted.has_after() || wanted.has_since_utc_ns();
  const std::size_t first = !paged && entries.size() > kMaxAuditReply ? entries.size() - kMaxAuditReply : 0;
  const std::size_t end = std::min(entries.size(), first + kMaxAuditReply);
  into.set_more(end < entries.size());
  for (const AuditEntry& entry : std::span(entries).subspan(first, end - first)) {
    wire::AuditEntry& added = *into.add_entries();
    added.set_number(entry.number);
    if (entry.at) added.set_at_ns(static_cast<std::uint64_t>((*entry.at - start).ns()));
    else added.set_earlier_run(true);
    added.set_utc_ns(entry.utc_ns);
    added.set_last_utc_ns(entry.last_utc_ns);
    added.set_count(entry.count);
    added.set_who(entry.who);
    added.set_what(entry.what);
    added.set_before(entry.before);
    added.set_after(entry.after);
    if (entry.error) *added.mutable_error() = to_wire(*entry.error);
  }
}

void fill_trial(const Trial& trial, Instant now, wire::Trial& into) {
  into.set_id(sha256_to_wire(trial.id));
  into.set_name(shown(trial.name));
  into.set_before(sha256_to_wire(trial.before));
  into.set_left_ns(static_cast<std::uint64_t>(std::max(trial.until - now, Duration()).ns()));
}

void fill_devices(const DeviceList& list, wire::Devices& into) {
  std::string_view rest = list.text;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    into.add_lines(shown(rest.substr(0, end)));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  into.set_json(list.json);
}

}  // namespace nodal::firmware
