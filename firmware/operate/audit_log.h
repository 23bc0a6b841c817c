// The audit log: every change of the rig with its author, its time, the old and the new value, and its result.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "firmware/operate/audit.h"
#include "firmware/storage/audit_store.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Keeps the newest entries, those of earlier runs included, and gives all to the AuditStore, which writes them.
///
/// Nobody can hide a change behind a flood of others:
/// - An important change that succeeded (a calibration, a deletion, the end of a host's connection) always has an entry
///   of its own. A party may make kImportantBurst of them in a row, then one every kImportantEvery: may_change() says
///   when.
/// - Of other entries, each party has kBurst of each kind, then one more every kRefill; a kind is a command, and
///   whether it succeeded. What is beyond, and what repeats the entry before, is merged to one entry with the count,
///   the first and the last time. It is written at the end of a window, which grows from kFirstWindow to kLongestWindow
///   while the flood lasts.
/// - While the disk does not take entries, changes must wait (full()) instead of being left out.
///
/// Threading: thread-bound to control.
/// Ownership: the store outlives it.
/// Errors: problem().
class AuditLog {
 public:
  /// The board's clock in nanoseconds since 1970; 0: unknown.
  using UtcClock = std::function<std::int64_t()>;

  AuditLog(AuditStore& store, UtcClock utc) : store_(store), utc_(std::move(utc)) {}

  /// Identifies an entry of this run until it is on the disk; 0: it was merged, and nobody waits for it.
  using Receipt = std::uint64_t;

  /// Records a change that `party`, a user at a socket, asked for.
  Receipt record(AuditEntry entry, const std::string& party, bool important, Instant now);
  /// Call once a step: exchanges entries and results with the store, and ends windows. True when something changed.
  bool step(Instant now);
  /// The rig ends: merged entries go to the store now.
  void flush(Instant now);

  /// Whether the party may make another important change now.
  bool may_change(const std::string& party, Instant now) const;
  /// The disk is behind: nothing may be changed until it has taken entries.
  bool full() const { return fresh_.size() >= kMaxFresh; }
  /// The entry is on the disk, or problem() says why it may not be.
  bool settled(Receipt receipt) const { return receipt <= settled_ || !problem_.empty(); }
  /// Why newest entries are not on the disk; empty: they are.
  const std::string& problem() const { return problem_; }
  /// The log of earlier runs has been read.
  bool loaded() const { return loaded_; }
  /// What was found wrong in it.
  const std::vector<std::string>& findings() const { return findings_; }

  /// Oldest first. Entries that are still merged come last and have the number 0.
  std::vector<AuditEntry> entries(std::uint64_t after, std::int64_t since_utc_ns) const;
  /// Number of the oldest entry that is kept; 0: there is none.
  std::uint64_t oldest() const { return entries_.empty() ? 0 : entries_.front().number; }
  /// Number and hash of the newest entry on the disk.
  std::uint64_t newest() const { return on_disk_; }
  const Sha256& head() const { return head_; }
  /// A line for the log for each change since the last call; it begins with "audit: ". News limits their rate.
  std::vector<std::string> take_lines() { return std::exchange(lines_, {}); }

  static constexpr std::size_t kMaxKept = 8192;  ///< entries in memory; the files have fewer
  static constexpr std::size_t kMaxFresh = 256;  ///< entries that the store has not taken
  static constexpr std::size_t kMaxKinds = 128;  ///< kinds of changes whose quotas are kept, over all parties
  static constexpr std::uint32_t kBurst = 16;
  static constexpr Duration kRefill = Duration::seconds(600);
  static constexpr std::uint32_t kImportantBurst = 128;
  static constexpr Duration kImportantEvery = Duration::seconds(5);
  static constexpr Duration kFirstWindow = Duration::seconds(10);
  static constexpr Duration kLongestWindow = Duration::seconds(3600);

 private:
  /// A quota that refills with time.
  struct Quota {
    std::uint32_t used = 0;
    Instant since;  ///< used was one more until then
    std::uint32_t used_at(Instant now, Duration refill) const;
    void use(Instant now, Duration refill);
  };
  struct Kind {
    Quota quota;
    std::string newest;                ///< text of its newest entry, to find repetitions
    std::optional<AuditEntry> merged;  ///< changes of the current window, merged into one entry; empty: none
    Instant window_end;
    Duration window = kFirstWindow;
    Instant used;
  };
  using KindKey = std::tuple<std::string, std::string, bool>;  ///< party, command, failed

  Kind& kind_of(const KindKey& key, Instant now);
  Receipt add(AuditEntry entry);
  void end_window(Kind& kind, Instant now);
  void take_report();
  void send();

  AuditStore& store_;
  const UtcClock utc_;
  bool loaded_ = false;
  std::deque<AuditEntry> entries_;
  std::deque<AuditEntry> fresh_;  ///< not given to the store yet; without numbers until the store has read its files
  std::uint64_t given_ = 0;       ///< number of the newest entry that the store has
  Receipt added_ = 0;             ///< number of entries of this run
  Receipt settled_ = 0;
  std::uint64_t first_number_ = 1;  ///< number of this run's first entry
  std::uint64_t on_disk_ = 0;
  Sha256 head_{};
  std::string problem_;
  std::vector<std::string> findings_;
  std::vector<std::string> lines_;
  std::map<KindKey, Kind> kinds_;
  std::map<std::string, Quota> important_;  ///< by party
};

}  // namespace nodal::firmware
