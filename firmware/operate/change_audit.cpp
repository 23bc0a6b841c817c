#include "firmware/operate/change_audit.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace nodal::firmware {
namespace {

const std::string& party_of(const Requester& requester) {
  return requester.party.empty() ? requester.name : requester.party;
}

AuditEntry entry_of(std::string who, std::string_view what, std::string before = {}, std::string after = {}) {
  AuditEntry entry;
  entry.who = std::move(who);
  entry.what = what;
  entry.before = std::move(before);
  entry.after = std::move(after);
  return entry;
}

}  // namespace

AuditLog::Receipt ChangeAudit::note_change(const Requester& requester, const Command& command, std::string before,
                                           std::string after, const Status& done, Instant now) {
  AuditEntry entry = entry_of(requester.name, kind_of(command).name, std::move(before), std::move(after));
  if (!done) entry.error = done.error();
  return log_.record(std::move(entry), party_of(requester), kind_of(command).important, now);
}

void ChangeAudit::note_refused(const Requester& requester, std::string_view what, const Error& why, Instant now) {
  AuditEntry entry = entry_of(requester.name, what);
  entry.error = why;
  log_.record(std::move(entry), party_of(requester), false, now);
}

void ChangeAudit::note_take_read(const Requester& requester, std::uint64_t take, Instant now) {
  log_.record(entry_of(requester.name, "take_read", "takes", fmt::format("take {} is read", take)), party_of(requester),
              false, now);
}

AuditLog::Receipt ChangeAudit::note_host_end(const Requester& requester, const std::string& host, Instant now) {
  return log_.record(entry_of(requester.name, "host_end", host, "closed"), party_of(requester), true, now);
}

void ChangeAudit::note_own_change(std::string cause, std::string_view what, std::string before, std::string after,
                                  Instant now) {
  log_.record(entry_of(std::move(cause), what, std::move(before), std::move(after)), "the rig", true, now);
}

bool ChangeAudit::may_change(const Requester& requester, bool important, Instant now) const {
  if (log_.full()) return false;
  return !important || log_.may_change(party_of(requester), now);
}

void ChangeAudit::step(bool flush, std::vector<Answer>& answers, Instant now) {
  log_.step(now);
  if (log_.loaded() && !std::exchange(said_findings_, true)) {
    // What is wrong with the log of earlier runs becomes an entry, so that it is known after its files were replaced.
    for (const std::string& finding : log_.findings()) {
      news_.say(NewsKind::kRig, finding);
      note_own_change("nodald", "audit", "the log of earlier runs", finding, now);
    }
  }
  if (flush) log_.flush(now);
  for (const std::string& line : log_.take_lines()) news_.say(NewsKind::kChanges, line);
  if (problem() != said_problem_) {
    said_problem_ = problem();
    news_.say(NewsKind::kRig, said_problem_.empty() ? "the audit log is written again" : said_problem_);
  }
  // Queries, and entries that are not important, have the receipt 0 and wait for nothing.
  const auto still_waiting =
      std::ranges::stable_partition(waiting_, [&](const Waiting& each) { return log_.settled(each.receipt); });
  for (auto each = waiting_.begin(); each != still_waiting.begin(); ++each) {
    if (each->receipt != 0) each->answer.not_recorded = problem();
    answers.push_back(std::move(each->answer));
  }
  waiting_.erase(waiting_.begin(), still_waiting.begin());
}

}  // namespace nodal::firmware
