// The stage that stores the audit log: a file to which records are only appended, each with the hash of the one before.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/frame/snapshot.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/base/spsc_ring.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// One record; operate/audit.h makes and reads its text.
struct AuditRecord {
  std::uint64_t number = 0;  ///< from 1, over all starts; the numbers of a whole log have no gap
  std::string text;          ///< one line of printable characters and tabs
};

/// The log on the disk when the rig started.
struct AuditReport {
  bool read = false;
  std::shared_ptr<const std::vector<AuditRecord>> records;  ///< oldest first; gaps are records that were removed
  std::uint64_t newest = 0;                                 ///< number of the newest record; 0: there is none
  std::vector<std::string> findings;  ///< what is wrong with the log, a sentence each: a torn end, a broken chain
};

/// The result of an attempt to write.
struct AuditWritten {
  std::uint64_t number = 0;  ///< this record and all before it are on the disk; after an error: were tried
  Sha256 head{};             ///< hash of the newest record on the disk
  Status status;
};

/// Files `audit` and `audit-before` in the root of the store's disk, beside the calibrations:
///
///   nodal-audit 1 <number of the record before the first> <hash of that record, or 64 zeros>
///   <hash> <number> <text>
///   ...
///
/// A record's hash is the SHA-256 of "<hash of the record before> <number> <text>", so that no record can be changed or
/// removed without changing all that follow; `sha256sum` checks it. Each record is written and synced on its own. So
/// after a power cut at most the last line is incomplete; it is reported at the next start, and cut off by the next
/// write. A whole line that does not fit to the one before is a broken chain: that is reported, and the line is kept.
///
/// When `audit` has kMaxFileBytes, it becomes `audit-before`, and a new `audit` continues the chain. A record that
/// cannot be written is tried again every kRetryEvery.
///
/// Threading: step() is thread-bound to the keeper's thread; writes() and answers() are SPSC rings with control,
///   snapshot() is read by control.
/// Ownership: the disk outlives it.
/// Errors: in the answers, and in the report's findings.
class AuditStore {
 public:
  explicit AuditStore(hal::DiskPort& disk);

  /// True when it did something: at most one record in a step.
  bool step(Instant now);

  /// Records in the order of their numbers, after the report's newest.
  SpscRing<AuditRecord>& writes() { return writes_; }
  SpscRing<AuditWritten>& answers() { return answers_; }
  Snapshot<AuditReport>& snapshot() { return snapshot_; }

  static constexpr std::uint64_t kMaxFileBytes = 512 * 1024;  ///< size limit of each of the two files
  static constexpr std::size_t kMaxUnwritten = 64;            ///< records in writes()
  static constexpr Duration kRetryEvery = Duration::seconds(10);

 private:
  void read();
  void read_file(const std::string& name, bool newest, AuditReport& report, std::vector<AuditRecord>& records);
  Status write(const std::string& line, const Sha256& before);
  Status rotate(const std::string& line);

  hal::DiskPort& disk_;
  SpscRing<AuditRecord> writes_;
  SpscRing<AuditWritten> answers_;
  Snapshot<AuditReport> snapshot_;
  bool read_ = false;
  Sha256 head_{};                      ///< hash of the newest record
  std::uint64_t newest_ = 0;           ///< its number
  std::uint64_t bytes_ = 0;            ///< valid bytes of kAuditFile; 0: the file must be made
  bool moved_ = false;                 ///< the file has its new name, and the new file is not made yet
  std::optional<AuditRecord> failed_;  ///< could not be written
  Instant retry_at_;
};

/// File names, in the root of the store's disk.
inline const std::string kAuditFile = "audit";
inline const std::string kAuditBeforeFile = "audit-before";

}  // namespace nodal::firmware
