#include "firmware/operate/audit_log.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "firmware/frame/drain.h"
#include "protocol/base/text.h"

namespace nodal::firmware {
namespace {

std::string text_of(const AuditEntry& entry) {
  return entry.what + ": " + entry.before + " -> " + entry.after +
         (entry.error ? ": failed: " + entry.error->text() : ": done");
}

}  // namespace

std::uint32_t AuditLog::Quota::used_at(Instant now, Duration refill) const {
  const std::int64_t refilled = std::max<std::int64_t>(0, (now - since).ns()) / refill.ns();
  return static_cast<std::uint32_t>(used - std::min<std::int64_t>(used, refilled));
}

void AuditLog::Quota::use(Instant now, Duration refill) {
  const std::uint32_t left = used_at(now, refill);
  since = left == 0 ? now : since + refill * static_cast<std::int64_t>(used - left);
  used = left + 1;
}

/// Forgets the quota that was not used for longest when there are too many.
AuditLog::Kind& AuditLog::kind_of(const KindKey& key, Instant now) {
  if (!kinds_.contains(key) && kinds_.size() >= kMaxKinds) {
    const auto oldest = std::ranges::min_element(kinds_, {}, [](const auto& each) { return each.second.used; });
    end_window(oldest->second, now);
    kinds_.erase(oldest);
  }
  Kind& kind = kinds_[key];
  kind.used = now;
  return kind;
}

AuditLog::Receipt AuditLog::record(AuditEntry entry, const std::string& party, bool important, Instant now) {
  entry.at = now;
  entry.utc_ns = entry.last_utc_ns = utc_();
  for (std::string* text : {&entry.who, &entry.what, &entry.before, &entry.after}) {
    *text = printable(*text, kMaxAuditText);
  }
  if (entry.error) entry.error->message = printable(entry.error->message, kMaxAuditText);
  const std::string text = text_of(entry);
  lines_.push_back("audit: " + entry.who + ": " + text);
  if (important && !entry.error) {
    if (important_.size() >= kMaxKinds && !important_.contains(party)) important_.clear();
    important_[party].use(now, kImportantEvery);
    return add(std::move(entry));
  }
  Kind& kind = kind_of({party, entry.what, entry.error.has_value()}, now);
  const bool repeats = text == kind.newest;
  kind.newest = text;
  if (!repeats && kind.quota.used_at(now, kRefill) < kBurst) {
    end_window(kind, now);
    kind.quota.use(now, kRefill);
    return add(std::move(entry));
  }
  if (!kind.merged) {
    kind.merged = std::move(entry);
    kind.window_end = now + kind.window;
    return 0;
  }
  kind.merged->last_utc_ns = entry.utc_ns;
  ++kind.merged->count;
  kind.merged->who = std::move(entry.who);
  kind.merged->after = std::move(entry.after);
  kind.merged->error = std::move(entry.error);
  return 0;
}

AuditLog::Receipt AuditLog::add(AuditEntry entry) {
  fresh_.push_back(std::move(entry));
  return ++added_;
}

/// Adds what was merged. The next window is longer, because the flood may go on.
void AuditLog::end_window(Kind& kind, Instant now) {
  if (!kind.merged) {
    kind.window = kFirstWindow;
    return;
  }
  add(*std::exchange(kind.merged, std::nullopt));
  kind.window = std::min(kind.window * 2, kLongestWindow);
  kind.window_end = now + kind.window;
}

bool AuditLog::may_change(const std::string& party, Instant now) const {
  const auto found = important_.find(party);
  return found == important_.end() || found->second.used_at(now, kImportantEvery) < kImportantBurst;
}

bool AuditLog::step(Instant now) {
  const std::uint64_t before = added_ + settled_;
  if (!loaded_) take_report();
  for (auto& [key, kind] : kinds_) {
    if (now >= kind.window_end && !full()) end_window(kind, now);
  }
  send();
  drain(store_.answers(), [&](const auto& written) {
    settled_ = written.number + 1 - first_number_;
    problem_.clear();
    if (written.status) {
      on_disk_ = written.number;
      head_ = written.head;
    } else {
      problem_ = written.status.error().message;
    }
  });
  return added_ + settled_ != before;
}

void AuditLog::flush(Instant now) {
  for (auto& [key, kind] : kinds_) end_window(kind, now);
  send();
}

void AuditLog::take_report() {
  const AuditReport& report = store_.snapshot().read();
  if (!report.read) return;
  loaded_ = true;
  given_ = on_disk_ = report.newest;
  first_number_ = report.newest + 1;
  findings_ = report.findings;
  for (const AuditRecord& record : *report.records) {
    auto entry = audit_entry_of(record.text);
    if (!entry) continue;
    entry->number = record.number;
    entries_.push_back(std::move(*entry));
  }
}

/// Numbers entries and gives them to the store, as many as it takes.
void AuditLog::send() {
  while (loaded_ && !fresh_.empty() && store_.writes().push({given_ + 1, to_line(fresh_.front())})) {
    fresh_.front().number = ++given_;
    entries_.push_back(std::move(fresh_.front()));
    fresh_.pop_front();
    if (entries_.size() > kMaxKept) entries_.pop_front();
  }
}

std::vector<AuditEntry> AuditLog::entries(std::uint64_t after, std::int64_t since_utc_ns) const {
  std::vector<AuditEntry> some;
  const auto wanted = [&](const AuditEntry& entry) {
    return (entry.number == 0 || entry.number > after) && (entry.last_utc_ns == 0 || entry.last_utc_ns >= since_utc_ns);
  };
  std::ranges::copy_if(entries_, std::back_inserter(some), wanted);
  std::ranges::copy_if(fresh_, std::back_inserter(some), wanted);
  for (const auto& [key, kind] : kinds_) {
    if (kind.merged && wanted(*kind.merged)) some.push_back(*kind.merged);
  }
  return some;
}

}  // namespace nodal::firmware
