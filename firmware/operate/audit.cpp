#include "firmware/operate/audit.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <utility>

#include "firmware/config/exposure_settings.h"
#include "protocol/base/text.h"

namespace nodal::firmware {
namespace {

/// Appends a part, after ", " unless it is the first.
void add(std::string& text, const std::string& part) { text += (text.empty() ? "" : ", ") + part; }

std::string text_of(const SettingsChange& set) {
  std::string text;
  if (set.exposure) add(text, fmt::format("exposure {} ns", set.exposure->duration().ns()));
  if (set.gain) add(text, fmt::format("gain {} mdB", set.gain->mdb()));
  if (set.white_balance) {
    add(text, fmt::format("white balance {}/{} q12", set.white_balance->red_q12, set.white_balance->blue_q12));
  }
  if (set.gamma) add(text, fmt::format("gamma {}/1000", set.gamma->thousandths()));
  return text;
}

/// One head's values in effect, only those that `set` names.
std::string text_of(const SettingsChange& set, const hal::HeadSettings& in_effect) {
  SettingsChange now;
  if (set.exposure) now.exposure = in_effect.exposure;
  if (set.gain) now.gain = in_effect.gain;
  if (set.white_balance) now.white_balance = in_effect.white_balance;
  if (set.gamma) now.gamma = in_effect.gamma;
  return text_of(now);
}

std::string heads_before(const HeadChange& set, const CaptureReport& capture) {
  std::string text;
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    if ((set.heads & head_bit(i)) == 0) continue;
    text += fmt::format("{}head {}: {}", text.empty() ? "" : "; ", i, text_of(set.change, capture.heads[i].in_effect));
  }
  return text;
}

std::string heads_after(const HeadChange& set, std::size_t heads) {
  if (set.heads == head_bit(heads) - 1) return "all heads: " + text_of(set.change);
  std::string named;
  for (std::size_t i = 0; i < heads; ++i) {
    if ((set.heads & head_bit(i)) != 0) add(named, std::to_string(i));
  }
  return "heads " + named + ": " + text_of(set.change);
}

/// The fields of `values`, only those that `named` has.
std::string text_of(const ExposureSettings& values, const ExposureChange& named) {
  const auto mstops = [](Stops stops) { return fmt::format("{} mstops", std::int64_t{stops} * 1000 / kStop); };
  std::string text;
  if (named.program) add(text, "program " + std::string(exposure_program_name(values.program)));
  if (named.anchor) add(text, values.anchor ? fmt::format("anchor {}", *values.anchor) : "anchor none");
  if (named.target) add(text, "target " + mstops(values.target));
  if (named.difference) add(text, "difference " + mstops(values.difference));
  if (named.ramp) add(text, "ramp " + mstops(values.ramp));
  if (named.longest) add(text, fmt::format("longest {} ns", values.longest.duration().ns()));
  if (named.highest) add(text, fmt::format("highest gain {} mdB", values.highest.mdb()));
  if (named.locked) add(text, values.locked ? "locked" : "not locked");
  return text;
}

std::string text_of(const FrameRate& rate) { return fmt::format("rate {}/{}", rate.numerator, rate.denominator); }

std::string text_of(const GenlockStart& start) {
  std::string text = "start";
  if (start.rate) add(text, text_of(*start.rate));
  if (start.pulse_width) add(text, fmt::format("pulse {} ns", start.pulse_width->ns()));
  return text;
}

}  // namespace

std::string to_line(const AuditEntry& entry) {
  std::string line = fmt::format("{}\t{}\t{}\t{}", entry.utc_ns, entry.last_utc_ns, entry.count,
                                 entry.error ? static_cast<std::uint32_t>(entry.error->code) : 0);
  const std::string message = entry.error ? entry.error->message : "";
  for (const std::string* text : {&entry.who, &entry.what, &entry.before, &entry.after, &message}) {
    line += "\t" + printable(*text, kMaxAuditText);
  }
  return line;
}

std::optional<AuditEntry> audit_entry_of(std::string_view line) {
  std::array<std::string_view, 9> fields;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const std::size_t end = line.find('\t');
    if ((end == std::string_view::npos) != (i + 1 == fields.size())) return std::nullopt;
    fields[i] = line.substr(0, end);
    line.remove_prefix(end == std::string_view::npos ? line.size() : end + 1);
  }
  const auto number = [](std::string_view text, auto& value) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size();
  };
  AuditEntry entry;
  std::uint32_t code = 0;
  if (!number(fields[0], entry.utc_ns) || !number(fields[1], entry.last_utc_ns) || !number(fields[2], entry.count) ||
      !number(fields[3], code)) {
    return std::nullopt;
  }
  entry.who = fields[4];
  entry.what = fields[5];
  entry.before = fields[6];
  entry.after = fields[7];
  if (code != 0) entry.error = Error{static_cast<Errc>(code), std::string(fields[8])};
  return entry;
}

std::string calibration_text(const std::optional<Sha256>& id) {
  return id ? "calibration " + to_hex(*id).substr(0, 12) : "no calibration";
}

std::string values_before(const Command& command, const CaptureReport& capture, const KeeperReport& keeper) {
  if (std::holds_alternative<TakeCommand>(command)) return "takes";
  const auto* change = std::get_if<CaptureCommand>(&command);
  if (!change) return calibration_text(keeper.in_force) + (keeper.trial ? " on trial" : "");
  if (const auto* heads = std::get_if<HeadChange>(change)) return heads_before(*heads, capture);
  if (const auto* exposure = std::get_if<ExposureChange>(change)) return text_of(capture.exposure.settings, *exposure);
  if (std::holds_alternative<LeaseEnd>(*change)) return "temporary settings";
  return std::string(genlock_state_name(capture.genlock.state)) + ", " + text_of(capture.genlock.rate);
}

std::string values_after(const Command& command, const RigConfig& config, const std::optional<Sha256>& in_force) {
  if (const auto* take = std::get_if<TakeCommand>(&command)) {
    if (const auto* mark = std::get_if<TakeRequest::Mark>(take)) return "mark '" + mark->text + "'";
    if (const auto* gone = std::get_if<TakeRequest::Delete>(take)) return fmt::format("take {} deleted", gone->take);
    if (const auto* kept = std::get_if<TakeRequest::Protect>(take)) {
      return fmt::format("take {}{}", kept->take, kept->on ? " protected" : " not protected");
    }
    if (std::holds_alternative<TakeRequest::TestDisk>(*take)) return "the disk is tested";
    if (std::holds_alternative<TakeRequest::Eject>(*take)) return "the disk is ejected";
    return std::holds_alternative<TakeRequest::Start>(*take) ? "a take is recorded" : "no take is recorded";
  }
  if (const auto* calibration = std::get_if<CalibrationCommand>(&command)) {
    const auto* install = std::get_if<CalibrationRequest::Install>(calibration);
    const auto* use = std::get_if<CalibrationRequest::Use>(calibration);
    const bool older = (install && install->allow_older) || (use && use->allow_older);
    return calibration_text(in_force) + (install && install->trial ? " on trial" : "") +
           (older ? ", an older signature is allowed" : "");
  }
  const CaptureCommand& change = std::get<CaptureCommand>(command);
  if (const auto* heads = std::get_if<HeadChange>(&change)) {
    return heads_after(*heads, config.heads.size()) + (heads->lease != 0 ? ", temporary" : "");
  }
  if (std::holds_alternative<LeaseEnd>(change)) return "as before";
  if (const auto* exposure = std::get_if<ExposureChange>(&change)) return text_of(exposure->applied_to({}), *exposure);
  const auto* start = std::get_if<GenlockStart>(&change);
  return start ? text_of(*start) : "stop";
}

}  // namespace nodal::firmware
