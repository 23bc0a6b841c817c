// The part of Operation that keeps the audit log.
#include <algorithm>
#include <utility>

#include "firmware/operate/operation.h"

namespace nodal::firmware {
namespace {

const std::string& party_of(const Requester& requester) {
  return requester.party.empty() ? requester.name : requester.party;
}

}  // namespace

AuditLog::Receipt Operation::audit(const Open& open, const std::optional<Sha256>& in_force, const Status& done,
                                   Instant now) {
  if (!changes_rig(open.command)) return 0;
  AuditEntry entry;
  entry.who = open.requester.name;
  entry.what = command_name(open.command);
  entry.before = open.before;
  entry.after = values_after(open.command, config_, in_force);
  if (!done) entry.error = done.error();
  return audit_.record(std::move(entry), party_of(open.requester), is_important(open.command), now);
}

void Operation::note_refused(const Requester& requester, std::string_view what, const Error& why, Instant now) {
  AuditEntry entry;
  entry.who = requester.name;
  entry.what = what;
  entry.error = why;
  audit_.record(std::move(entry), party_of(requester), false, now);
}

void Operation::note_take_read(const Requester& requester, std::uint64_t take, Instant now) {
  AuditEntry entry;
  entry.who = requester.name;
  entry.what = "take_read";
  entry.before = "takes";
  entry.after = "take " + std::to_string(take) + " is read";
  audit_.record(std::move(entry), party_of(requester), false, now);
}

Ticket Operation::note_host_end(const Requester& requester, const std::string& host, Instant now) {
  AuditEntry entry;
  entry.who = requester.name;
  entry.what = "host_end";
  entry.before = host;
  entry.after = "closed";
  const Ticket ticket = next_ticket_++;
  answer_when_recorded({ticket, Outcome(CommandDone{})},
                       audit_.record(std::move(entry), party_of(requester), true, now));
  return ticket;
}

bool Operation::may_change(const Requester& requester, bool important, Instant now) const {
  if (audit_.full()) return false;
  return !important || audit_.may_change(party_of(requester), now);
}

void Operation::answer_when_recorded(Answer answer, AuditLog::Receipt receipt) {
  unrecorded_.push_back({std::move(answer), receipt});
}

/// Releases answers whose entries are on the disk. Queries and entries without an importance have waited for nothing.
void Operation::step_audit(std::vector<Answer>& answers, Instant now) {
  audit_.step(now);
  if (audit_.loaded() && !std::exchange(findings_told_, true)) {
    for (const std::string& finding : audit_.findings()) note_finding(finding, now);
  }
  if (asked_to_end()) audit_.flush(now);
  for (const std::string& line : audit_.take_lines()) news_.say(NewsKind::kChanges, line);
  if (audit_.problem() != audit_problem_) {
    audit_problem_ = audit_.problem();
    news_.say(NewsKind::kRig, audit_problem_.empty() ? "the audit log is written again" : audit_problem_);
  }
  const auto waiting =
      std::ranges::stable_partition(unrecorded_, [&](const Unrecorded& each) { return audit_.settled(each.receipt); });
  for (auto each = unrecorded_.begin(); each != waiting.begin(); ++each) {
    if (each->receipt != 0) each->answer.not_recorded = audit_.problem();
    answers.push_back(std::move(each->answer));
  }
  unrecorded_.erase(unrecorded_.begin(), waiting.begin());
}

/// What is wrong with the log of earlier runs becomes an entry, so that it is known after the files have been replaced.
void Operation::note_finding(const std::string& finding, Instant now) {
  news_.say(NewsKind::kRig, finding);
  AuditEntry entry;
  entry.who = "nodald";
  entry.what = "audit";
  entry.before = "the log of earlier runs";
  entry.after = finding;
  audit_.record(std::move(entry), "the rig", true, now);
}

}  // namespace nodal::firmware
