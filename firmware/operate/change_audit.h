// Entries of the audit log for what hosts, the button and the rig itself do; answers that wait for an entry.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/operate/audit.h"
#include "firmware/operate/audit_log.h"
#include "firmware/operate/commands.h"
#include "firmware/operate/news.h"
#include "firmware/storage/audit_store.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// An important change is answered only when its entry is on the disk, or when it is known why it may not be.
///
/// Threading: thread-bound to control.
/// Ownership: the store and the news outlive it.
/// Errors: problem(); an answer says when its entry is not on the disk.
class ChangeAudit {
 public:
  ChangeAudit(AuditStore& store, AuditLog::UtcClock utc, News& news) : log_(store, std::move(utc)), news_(news) {}

  using Receipt = AuditLog::Receipt;

  /// A change of the rig that was carried out or has failed. `before` and `after`: old and new values.
  Receipt note_change(const Requester& requester, const Command& command, std::string before, std::string after,
                      const Status& done, Instant now);
  /// A requested change that could not be mapped to a command.
  void note_refused(const Requester& requester, std::string_view what, const Error& why, Instant now);
  void note_take_read(const Requester& requester, std::uint64_t take, Instant now);
  Receipt note_host_end(const Requester& requester, const std::string& host, Instant now);
  /// What the rig did without a request, by this cause.
  void note_own_change(std::string cause, std::string_view what, std::string before, std::string after, Instant now);
  /// Whether the log takes a change of this requester now; otherwise it must wait.
  bool may_change(const Requester& requester, bool important, Instant now) const;

  void answer_when_recorded(Answer answer, Receipt receipt) { waiting_.push_back({std::move(answer), receipt}); }
  /// Number of answers that wait.
  std::size_t waiting() const { return waiting_.size(); }
  /// Exchanges entries with the store, and appends the answers whose entries are on the disk. `flush`: the rig ends.
  void step(bool flush, std::vector<Answer>& answers, Instant now);

  const std::string& problem() const { return log_.problem(); }
  const AuditLog& log() const { return log_; }

 private:
  struct Waiting {
    Answer answer;
    Receipt receipt = 0;
  };

  AuditLog log_;
  News& news_;
  std::vector<Waiting> waiting_;
  std::string said_problem_;  ///< the problem that was logged last; empty: none
  bool said_findings_ = false;
};

}  // namespace nodal::firmware
