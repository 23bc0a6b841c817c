// The calibrations that a rig stores. The disk or the power may fail at any moment.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/calibration.h"

namespace nodal::firmware {

/// Enough of an id to name a calibration in a message.
std::string short_id(const Sha256& id);

/// A calibration exactly as it was signed: the signature is for these bytes, not for the canonical form.
struct SignedDocument {
  std::string signature;
  std::string json;
};

/// Folder "calibrations" of the disk:
///
///   00000007-<id>.json   the canonical form of generation 7; its SHA-256 is the id in its name
///   00000007-<id>.signed its signature and the signed document, if it was uploaded with a signature
///   in-force             the id in force, and the id that was in force before
///   signed               the highest generation of a signature that was permitted
///   *.tmp                incomplete file of a write; removed at open()
///
/// Every file is made by write, fsync, rename, fsync of the folder. So after a crash or power cut in any operation
/// either the old calibration or the new one is in force, complete.
///
/// Threading: thread-bound to the keeper. Calls block on the disk.
/// Ownership: the disk outlives it.
/// Errors: kDiskFull, kIo, kNotFound, kWrongState; after an error, the calibration in force is the same as before.
class CalibrationStore {
 public:
  struct Entry {
    std::uint64_t generation = 0;
    Sha256 id{};
    std::string name;
    std::size_t heads = 0;
    std::string file;
  };

  /// Generations that are kept. The one in force and the one before are never removed.
  static constexpr std::size_t kKept = 8;
  /// Generations that open() reads: the newest, and beside them the one in force and the one before.
  static constexpr std::size_t kMaxRead = 64;

  /// Reads the folder. A damaged calibration is skipped and named by note(); if it was the one in force, the newest
  /// good one is put in its place.
  static Result<CalibrationStore> open(hal::DiskPort& disk);

  /// The undamaged calibrations, newest first.
  const std::vector<Entry>& entries() const { return entries_; }
  const std::optional<Sha256>& in_force() const { return in_force_; }
  /// The one that a rollback puts in force; empty when there is none.
  const std::optional<Sha256>& before() const { return before_; }
  /// One sentence about the faults found by open(); empty when there were none.
  const std::string& note() const { return note_; }

  /// Stores a calibration durably, without putting it in force. If it is stored already, only its signature is
  /// replaced, and only if `original` has one.
  Result<Entry> put(const Calibration& calibration, const std::optional<SignedDocument>& original = std::nullopt);
  /// The signed document of a stored calibration; empty if it was not signed. Errors: kChecksum when it is damaged.
  Result<std::optional<SignedDocument>> original(const Sha256& id) const;
  /// Puts a stored calibration in force on the disk, and removes generations beyond kKept.
  Status set_in_force(const Sha256& id);
  /// The highest generation of a signature that was permitted; 0: none.
  std::uint64_t signed_generation() const { return signed_generation_; }
  /// Stores it durably if it is higher.
  Status note_signed(std::uint64_t generation);
  /// Removes a calibration, unless it is in force or was in force before.
  void remove(const Sha256& id);

  /// The calibration whose id begins with these bytes. Errors: kNotFound; kBadValue when there are several.
  Result<Entry> find(std::string_view id_prefix) const;
  /// The canonical form, checked against the id.
  Result<std::string> read(const Sha256& id) const;
  Result<Calibration> load(const Sha256& id) const;

 private:
  explicit CalibrationStore(hal::DiskPort& disk) : disk_(&disk) {}
  Status read_folder();
  void read_entry(Entry found);
  void parse_pointer();
  void drop_copies();
  Result<std::string> read(const Entry& entry) const;
  Result<Calibration> load(const Entry& entry) const;
  void follow_pointer();
  void read_signed();
  void drop_if_orphan(const std::string& file);
  const Entry* entry(const Sha256& id) const;
  Status write_pointer(const std::optional<Sha256>& in_force, const std::optional<Sha256>& before);
  void prune();
  void add_note(const std::string& sentence);

  hal::DiskPort* disk_;
  std::vector<Entry> entries_;
  /// Files of damaged calibrations, of copies, and of more old generations than are read; prune() removes them first.
  std::vector<std::string> damaged_;
  std::optional<Sha256> pointed_at_;  ///< by the pointer on the disk
  std::optional<Sha256> in_force_;
  std::optional<Sha256> before_;
  std::uint64_t next_generation_ = 1;
  std::uint64_t signed_generation_ = 0;
  std::string note_;
};

}  // namespace nodal::firmware
