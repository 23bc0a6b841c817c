#include "host_tool/rig/wire_json.h"

#include <fmt/format.h>

#include <algorithm>

namespace nodal::host {
namespace {

template <class Counts>
Json counts_to_json(const Counts& counts) {
  Json json = Json::object();
  for (const wire::Count& count : counts) json[count.reason()] = count.frames();
  return json;
}

Json rate_to_json(std::uint32_t numerator, std::uint32_t denominator) {
  return {{"numerator", numerator}, {"denominator", denominator}};
}

Json marks_to_json(const wire::RigStatus& status) {
  Json json = Json::array();
  for (const wire::Mark& mark : status.marks()) json.push_back({{"set", mark.set()}, {"at_ns", mark.at_ns()}});
  return json;
}

}  // namespace

std::string hex_of(const std::string& bytes) {
  std::string hex;
  for (const char byte : bytes) hex += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return hex;
}

Json to_json(const wire::Genlock& genlock) {
  Json pulse_losses = Json::object();
  for (const wire::PulseCount& count : genlock.pulse_losses()) pulse_losses[count.reason()] = count.pulses();
  return {{"state", genlock.state()},
          {"rate", rate_to_json(genlock.rate_numerator(), genlock.rate_denominator())},
          {"triggers", genlock.triggers()},
          {"spread_ns", genlock.spread_ns()},
          {"spread_worst_ns", genlock.spread_worst_ns()},
          {"missing_triggers", genlock.missing_triggers()},
          {"pulse_losses", pulse_losses},
          {"losses", genlock.losses()},
          {"holdovers", genlock.holdovers()},
          {"drift_ppb", genlock.has_drift_ppb() ? Json(genlock.drift_ppb()) : Json()},
          {"aligned", genlock.aligned()},
          {"unaligned", Json(std::vector<std::string>(genlock.unaligned().begin(), genlock.unaligned().end()))}};
}

Json to_json(const wire::ExposureState& exposure) {
  const wire::ExposureRequest& settings = exposure.settings();
  Json heads = Json::array();
  for (const wire::HeadExposure& head : exposure.heads()) {
    heads.push_back({{"index", head.index()},
                     {"metered", head.metered()},
                     {"exposure_millistops", head.exposure()},
                     {"goal_millistops", head.goal()},
                     {"light_millistops", head.light()},
                     {"clipped_ppm", head.clipped_ppm()},
                     {"black_ppm", head.black_ppm()}});
  }
  return {{"program", settings.program()},
          {"locked", settings.locked()},
          {"anchor", settings.anchor()},
          {"target_below_millistops", settings.target_below()},
          {"difference_millistops", settings.difference()},
          {"ramp_millistops", settings.ramp()},
          {"longest_ns", settings.longest_ns()},
          {"highest_gain_mdb", settings.highest_gain_mdb()},
          {"settled", exposure.settled()},
          {"sets", exposure.sets()},
          {"set", exposure.set()},
          {"light_millistops", exposure.light()},
          {"sphere_ppm", exposure.sphere_ppm()},
          {"heads", heads}};
}

Json to_json(const wire::RigStatus& status, const std::string& rig_name, const std::string& address) {
  Json recording;  // null: the rig records nothing
  if (status.has_recording()) {
    const wire::Recording& takes = status.recording();
    recording = {{"take", takes.has_take() ? Json(takes.take()) : Json()},
                 {"length_ns", takes.length_ns()},
                 {"sets", takes.sets()},
                 {"lost_sets", takes.lost_sets()},
                 {"lost_by_errors", takes.lost_by_errors()},
                 {"lost_raymaps", takes.lost_raymaps()},
                 {"jpeg_quality", takes.quality()},
                 {"leaves_out_raymaps", takes.leaves_out_raymaps()},
                 {"buffer_percent", takes.buffer_percent()},
                 {"durable_ns", takes.has_durable_ns() ? Json(takes.durable_ns()) : Json()},
                 {"free_bytes", takes.free_bytes()},
                 {"total_bytes", takes.total_bytes()},
                 {"bytes_a_second", takes.bytes_a_second()},
                 {"loop", takes.loop()},
                 {"deleted_segments", takes.deleted_segments()},
                 {"ejected", takes.ejected()},
                 {"problem", takes.problem()}};
  }
  Json seams;  // null: they are fixed
  if (status.has_seams()) {
    seams = {
        {"placed", status.seams().placed()}, {"late", status.seams().late()}, {"refused", status.seams().refused()}};
  }
  Json trial;  // null: no trial
  if (status.has_trial()) {
    trial = {{"id", hex_of(status.trial().id())},
             {"name", status.trial().name()},
             {"before", hex_of(status.trial().before())},
             {"left_ns", status.trial().left_ns()}};
  }
  return {{"rig", rig_name},
          {"address", address},
          {"state", status.state()},
          {"problem", status.problem()},
          {"activity", status.activity()},
          {"uptime_ns", status.uptime_ns()},
          {"clock_ns", status.clock_ns()},
          {"sets", status.sets()},
          {"full_sets", status.full_sets()},
          {"set_losses", counts_to_json(status.set_losses())},
          {"raymaps", status.raymaps()},
          {"raymaps_a_set", std::max(1U, status.raymaps_a_set())},
          {"published", status.published()},
          {"publish_drops", counts_to_json(status.publish_drops())},
          {"publish_shed", status.publish_shed()},
          {"marks", marks_to_json(status)},
          {"rate_wanted_millihertz", status.rate_wanted_millihertz()},
          {"rate_millihertz", status.rate_millihertz()},
          {"frames_taken", status.frames_taken()},
          {"frames_in_sets", status.frames_in_sets()},
          {"frames_held", status.frames_held()},
          {"losses", counts_to_json(status.losses())},
          {"calibration_id", hex_of(status.calibration_id())},
          {"calibration_name", status.calibration_name()},
          {"trial", trial},
          {"seams", seams},
          {"recording", recording},
          {"genlock", to_json(status.genlock())},
          {"blend_ns", status.blend_ns()},
          {"encode_ns", status.encode_ns()},
          {"encode_failures", status.encode_failures()},
          {"resident_bytes", status.resident_bytes()},
          {"raymap_width", status.raymap_width()},
          {"raymap_height", status.raymap_height()}};
}

Json to_json(const wire::HeadState& head) {
  return {{"index", head.index()},
          {"name", head.name()},
          {"path", head.path()},
          {"model", head.model()},
          {"serial", head.serial()},
          {"present", head.present()},
          {"format", head.format()},
          {"trigger", head.trigger()},
          {"exposure_ns", head.exposure_ns()},
          {"exposure_min_ns", head.exposure_min_ns()},
          {"exposure_max_ns", head.exposure_max_ns()},
          {"gain_mdb", head.gain_mdb()},
          {"gain_min_mdb", head.gain_min_mdb()},
          {"gain_max_mdb", head.gain_max_mdb()},
          {"red_q12", head.red_q12()},
          {"blue_q12", head.blue_q12()},
          {"gamma", head.gamma()},
          {"frames", head.frames()},
          {"losses", counts_to_json(head.losses())},
          {"missing_sets", head.missing_sets()},
          {"opened", head.opened()},
          {"skew_ns", head.skew_ns()},
          {"drift_ppb", head.has_drift_ppb() ? Json(head.drift_ppb()) : Json()},
          {"problem", head.problem()}};
}

Json to_json(const wire::Heads& heads) {
  Json list = Json::array();
  for (const wire::HeadState& head : heads.heads()) list.push_back(to_json(head));
  return {{"heads", list}};
}

Json to_json(const wire::CalibrationEntry& entry) {
  return {{"id", hex_of(entry.id())},         {"name", entry.name()},         {"heads", entry.heads()},
          {"generation", entry.generation()}, {"in_force", entry.in_force()}, {"on_trial", entry.on_trial()}};
}

}  // namespace nodal::host
