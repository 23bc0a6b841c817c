#include "host_tool/rig/rig_input.h"

#include <fmt/format.h>

#include <string>
#include <string_view>

#include "protocol/base/sha256.h"
#include "protocol/base/text.h"
#include "protocol/base/units.h"

namespace nodal::host {
namespace {

/// Checks a message and keeps the first error.
class Check {
 public:
  void name(std::string* text) { *text = printable(*text, kMaxNameBytes); }
  void sentence(std::string* text) { *text = printable(*text, kMaxSentenceBytes); }

  template <class List>
  void list(const List& entries, int most, std::string_view what) {
    if (entries.size() <= most || !result_) return;
    result_ = fail(Errc::kTooLarge,
                   fmt::format("the rig sent a list of {} {}; at most {} are accepted", entries.size(), what, most));
  }
  template <class List>
  void counts(List& entries, std::string_view what) {
    list(entries, kMaxCounts, what);
    for (wire::Count& count : entries) name(count.mutable_reason());
  }
  /// Checks a list with one entry per head, or none.
  template <class List>
  void by_head(const List& entries) {
    list(entries, kMaxHeads, "heads");
  }
  /// Checks a SHA-256, or an empty text for none.
  void id(const std::string& bytes) {
    if (bytes.empty() || bytes.size() == Sha256{}.size() || !result_) return;
    result_ = fail(Errc::kBadFormat, fmt::format("the rig sent a calibration's id of {} bytes", bytes.size()));
  }

  Status result() const { return result_; }

 private:
  Status result_;
};

void clean(Check& check, wire::Genlock& genlock) {
  check.name(genlock.mutable_state());
  check.list(genlock.unaligned(), kMaxSentences, "heads that cannot be aligned");
  for (std::string& why : *genlock.mutable_unaligned()) check.sentence(&why);
  check.list(genlock.pulse_losses(), kMaxCounts, "losses of pulses");
  for (wire::PulseCount& count : *genlock.mutable_pulse_losses()) check.name(count.mutable_reason());
}

void clean(Check& check, wire::RigStatus& status) {
  check.name(status.mutable_state());
  check.name(status.mutable_calibration_name());
  check.name(status.mutable_rig_name());
  check.sentence(status.mutable_problem());
  check.sentence(status.mutable_activity());
  check.counts(*status.mutable_losses(), "losses");
  check.counts(*status.mutable_set_losses(), "losses of sets");
  check.counts(*status.mutable_publish_drops(), "clients that miss raymaps");
  check.list(status.marks(), kMaxMarks, "marks");
  check.id(status.calibration_id());
  clean(check, *status.mutable_genlock());
  if (status.has_recording()) check.sentence(status.mutable_recording()->mutable_problem());
  if (!status.has_trial()) return;
  check.name(status.mutable_trial()->mutable_name());
  check.id(status.trial().id());
  check.id(status.trial().before());
}

void clean(Check& check, wire::Heads& heads) {
  check.by_head(heads.heads());
  for (wire::HeadState& head : *heads.mutable_heads()) {
    check.name(head.mutable_name());
    check.name(head.mutable_path());
    check.name(head.mutable_model());
    check.name(head.mutable_serial());
    check.name(head.mutable_format());
    check.name(head.mutable_trigger());
    check.sentence(head.mutable_problem());
    check.counts(*head.mutable_losses(), "losses of a head");
  }
}

void clean(Check& check, wire::AuditLog& log) {
  check.list(log.entries(), kMaxAuditEntries, "changes");
  check.list(log.findings(), kMaxSentences, "findings");
  for (std::string& finding : *log.mutable_findings()) check.sentence(&finding);
  check.sentence(log.mutable_problem());
  for (wire::AuditEntry& entry : *log.mutable_entries()) {
    check.sentence(entry.mutable_who());
    check.name(entry.mutable_what());
    check.sentence(entry.mutable_before());
    check.sentence(entry.mutable_after());
    if (entry.has_error()) check.sentence(entry.mutable_error()->mutable_message());
  }
}

void clean(Check& check, wire::Hosts& hosts) {
  check.list(hosts.hosts(), kMaxHosts, "hosts");
  for (wire::HostState& host : *hosts.mutable_hosts()) {
    check.sentence(host.mutable_peer());
    check.name(host.mutable_software());
    check.list(host.streams(), kMaxSentences, "streams of a host");
    for (std::string& stream : *host.mutable_streams()) check.name(&stream);
  }
}

void clean(Check& check, wire::Calibrations& calibrations) {
  check.list(calibrations.entries(), kMaxCalibrations, "calibrations");
  for (wire::CalibrationEntry& entry : *calibrations.mutable_entries()) {
    check.name(entry.mutable_name());
    check.id(entry.id());
  }
}

}  // namespace

Status check_and_clean(wire::Hello& hello) {
  Check check;
  check.name(hello.mutable_software());
  check.name(hello.mutable_rig_name());
  check.list(hello.features(), kMaxSentences, "features");
  for (std::string& feature : *hello.mutable_features()) check.name(&feature);
  check.id(hello.calibration_id());
  return check.result();
}

Status check_and_clean(wire::Reply& reply) {
  Check check;
  if (reply.has_error()) check.sentence(reply.mutable_error()->mutable_message());
  check.sentence(reply.mutable_not_stored());
  check.sentence(reply.mutable_not_recorded());
  switch (reply.what_case()) {
    case wire::Reply::kStatus: clean(check, *reply.mutable_status()); break;
    case wire::Reply::kHeads: clean(check, *reply.mutable_heads()); break;
    case wire::Reply::kGenlock: clean(check, *reply.mutable_genlock()); break;
    case wire::Reply::kCalibrations: clean(check, *reply.mutable_calibrations()); break;
    case wire::Reply::kExposure:
      check.by_head(reply.exposure().heads());
      check.name(reply.mutable_exposure()->mutable_settings()->mutable_program());
      break;
    case wire::Reply::kAuditLog: clean(check, *reply.mutable_audit_log()); break;
    case wire::Reply::kHosts: clean(check, *reply.mutable_hosts()); break;
    case wire::Reply::kDevices:
      check.list(reply.devices().lines(), kMaxDeviceLines, "lines about devices");
      for (std::string& line : *reply.mutable_devices()->mutable_lines()) check.sentence(&line);
      break;
    case wire::Reply::kTakes:
      check.list(reply.takes().takes(), kMaxTakes, "takes");
      for (wire::TakeEntry& take : *reply.mutable_takes()->mutable_takes()) {
        check.name(take.mutable_state());
        check.name(take.mutable_ended());
        check.sentence(take.mutable_problem());
      }
      break;
    case wire::Reply::kDiskTest:
      check.list(reply.disk_test().modes(), kMaxDiskModes, "modes");
      for (wire::DiskMode& mode : *reply.mutable_disk_test()->mutable_modes()) {
        check.name(mode.mutable_mode());
        check.sentence(mode.mutable_why());
      }
      break;
    case wire::Reply::kCalibration: check.id(reply.calibration().id()); break;
    case wire::Reply::kDone:
    case wire::Reply::kTake:
    case wire::Reply::kUpload:
    case wire::Reply::kPull:
    case wire::Reply::WHAT_NOT_SET: break;
  }
  return check.result();
}

Status check_and_clean(wire::RaymapHeader& header) {
  Check check;
  check.name(header.mutable_coding());
  check.name(header.mutable_layout());
  check.name(header.mutable_genlock());
  check.name(header.mutable_parity());
  check.by_head(header.offset_ns());
  check.by_head(header.exposure_ns());
  check.by_head(header.gain_mdb());
  check.id(header.calibration_id());
  if (!FrameRate::make(header.rate_numerator(), header.rate_denominator())) {
    header.clear_rate_numerator();
    header.clear_rate_denominator();
  }
  return check.result();
}

Status check_and_clean(wire::FrameSetHeader& header) {
  Check check;
  check.name(header.mutable_genlock());
  check.by_head(header.heads());
  for (wire::HeadPicture& head : *header.mutable_heads()) {
    check.name(head.mutable_name());
    check.name(head.mutable_format());
  }
  check.id(header.calibration_id());
  return check.result();
}

/// It has no text.
Status check_and_clean(wire::TakePiece&) { return {}; }

}  // namespace nodal::host
