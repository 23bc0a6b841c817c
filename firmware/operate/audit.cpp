#include "firmware/operate/audit.h"

#include <utility>

#include "firmware/hosts/status.h"
#include "protocol/base/text.h"

namespace nodal::firmware {
namespace {

std::string calibration_text(const std::optional<Sha256>& id) {
  return id ? "calibration " + to_hex(*id).substr(0, 12) : "no calibration";
}

/// "a, b": the parts that are there.
void add(std::string& text, const std::string& part) { text += (text.empty() ? "" : ", ") + part; }

std::string text_of(const wire::HeadSetRequest& set) {
  std::string text;
  if (set.has_exposure_ns()) add(text, "exposure " + std::to_string(set.exposure_ns()) + " ns");
  if (set.has_gain_mdb()) add(text, "gain " + std::to_string(set.gain_mdb()) + " mdB");
  if (set.has_red_q12()) {
    add(text, "white balance " + std::to_string(set.red_q12()) + "/" + std::to_string(set.blue_q12()) + " q12");
  }
  if (set.has_gamma()) add(text, "gamma " + std::to_string(set.gamma()) + "/1000");
  return text;
}

/// The values in effect that `set` names, of one head.
std::string text_of(const wire::HeadSetRequest& set, const HeadReport& head) {
  wire::HeadSetRequest now;
  if (set.has_exposure_ns()) now.set_exposure_ns(static_cast<std::uint64_t>(head.in_effect.exposure.duration().ns()));
  if (set.has_gain_mdb()) now.set_gain_mdb(head.in_effect.gain.mdb());
  if (set.has_red_q12()) {
    now.set_red_q12(head.in_effect.white_balance.red_q12);
    now.set_blue_q12(head.in_effect.white_balance.blue_q12);
  }
  if (set.has_gamma()) now.set_gamma(static_cast<std::uint32_t>(head.in_effect.gamma.thousandths()));
  return text_of(now);
}

std::string heads_before(const wire::HeadSetRequest& set, const CaptureReport& capture) {
  std::string text;
  const auto head = [&](std::size_t i) {
    if (i >= capture.heads.size()) return;
    text += (text.empty() ? "" : "; ") + ("head " + std::to_string(i) + ": ") + text_of(set, capture.heads[i]);
  };
  for (const std::uint32_t i : set.heads()) head(i);
  for (std::size_t i = 0; set.heads().empty() && i < capture.heads.size(); ++i) head(i);
  return text;
}

std::string heads_after(const wire::HeadSetRequest& set) {
  std::string heads;
  for (const std::uint32_t i : set.heads()) add(heads, std::to_string(i));
  return (heads.empty() ? "all heads: " : "heads " + heads + ": ") + text_of(set);
}

/// The fields of `values` that `named` has.
std::string text_of(const wire::ExposureRequest& values, const wire::ExposureRequest& named) {
  std::string text;
  if (named.has_program()) add(text, "program " + values.program());
  if (named.has_anchor()) add(text, "anchor " + std::to_string(values.anchor()));
  if (named.has_target_below()) add(text, "target -" + std::to_string(values.target_below()) + " mstops");
  if (named.has_difference()) add(text, "difference " + std::to_string(values.difference()) + " mstops");
  if (named.has_ramp()) add(text, "ramp " + std::to_string(values.ramp()) + " mstops");
  if (named.has_longest_ns()) add(text, "longest " + std::to_string(values.longest_ns()) + " ns");
  if (named.has_highest_gain_mdb()) add(text, "highest gain " + std::to_string(values.highest_gain_mdb()) + " mdB");
  if (named.has_locked()) add(text, values.locked() ? "locked" : "not locked");
  return text;
}

std::string rate_text(std::uint32_t numerator, std::uint32_t denominator) {
  return std::to_string(numerator) + "/" + std::to_string(denominator);
}

std::string text_of(const wire::GenlockRequest& genlock) {
  std::string text = genlock.action() == wire::GenlockRequest::START ? "start" : "stop";
  if (genlock.rate_numerator() != 0)
    add(text, "rate " + rate_text(genlock.rate_numerator(), genlock.rate_denominator()));
  if (genlock.pulse_width_ns() != 0) add(text, "pulse " + std::to_string(genlock.pulse_width_ns()) + " ns");
  return text;
}

}  // namespace

std::string AuditLog::record(AuditEntry entry) {
  entry.number = ++count_;
  for (std::string* text : {&entry.who, &entry.what, &entry.before, &entry.after}) {
    *text = printable(*text, kLongestText);
  }
  if (entry.error) entry.error->message = printable(entry.error->message, kLongestText);
  std::string line = "audit: " + entry.who + ": " + entry.what + ": " + entry.before + " -> " + entry.after +
                     (entry.error ? ": failed: " + entry.error->text() : ": done");
  entries_.push_back(std::move(entry));
  if (entries_.size() > kKept) entries_.pop_front();
  return line;
}

std::string values_before(const wire::Request& request, const RigConfig& config, const CaptureReport& capture,
                          const KeeperReport& keeper) {
  if (request.has_head_set()) return heads_before(request.head_set(), capture);
  if (request.has_exposure()) {
    wire::ExposureState state;
    fill_exposure(capture.exposure, config.heads.size(), state);
    return text_of(state.settings(), request.exposure());
  }
  if (request.has_genlock()) {
    return std::string(genlock_state_name(capture.genlock.state)) + ", rate " +
           rate_text(capture.genlock.rate.numerator, capture.genlock.rate.denominator);
  }
  return calibration_text(keeper.in_force) + (keeper.trial ? " on trial" : "");
}

std::string values_after(const wire::Request& request, const std::optional<Sha256>& in_force) {
  if (request.has_head_set()) return heads_after(request.head_set());
  if (request.has_exposure()) return text_of(request.exposure(), request.exposure());
  if (request.has_genlock()) return text_of(request.genlock());
  return calibration_text(in_force) + (request.upload_commit().has_trial_ns() ? " on trial" : "");
}

void fill_audit(const AuditLog& log, Instant start, wire::AuditLog& into) {
  for (const AuditEntry& entry : log.entries()) {
    wire::AuditEntry& told = *into.add_entries();
    told.set_number(entry.number);
    told.set_at_ns(static_cast<std::uint64_t>((entry.at - start).ns()));
    told.set_who(entry.who);
    told.set_what(entry.what);
    told.set_before(entry.before);
    told.set_after(entry.after);
    if (entry.error) *told.mutable_error() = to_wire(*entry.error);
  }
}

}  // namespace nodal::firmware
