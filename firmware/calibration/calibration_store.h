// The calibrations a rig keeps, on a disk that may be pulled from under it at any moment.
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

/// A calibration as its signer had it: the signature is of these bytes, not of the canonical form.
struct SignedDocument {
  std::string signature;
  std::string json;
};

/// Folder "calibrations" of the disk:
///
///   00000007-<id>.json   the canonical form of generation 7; its SHA-256 is the id in its name
///   00000007-<id>.signed its signature and the document that was signed, where it came with one
///   in-force             which id is in force, and which was before it
///   *.tmp                being written; removed at open()
///
/// Every file comes into being by write, fsync, rename, fsync of the folder; so whatever operation the program or the
/// power dies in, after it either the old calibration or the new one is in force, whole.
///
/// Threading: thread-bound to the keeper. Calls take as long as the disk does.
/// Ownership: the disk outlives it.
/// Errors: kDiskFull, kIo, kNotFound, kWrongState; each leaves in force what was.
class CalibrationStore {
 public:
  struct Entry {
    std::uint64_t generation = 0;
    Sha256 id{};
    std::string name;
    std::size_t heads = 0;
    std::string file;
  };

  /// Generations. The one in force and the one before are never among the removed.
  static constexpr std::size_t kKept = 8;

  /// Reads what is there. A damaged calibration is passed over, and note() says so; when it was the one in force, the
  /// newest good one takes its place.
  static Result<CalibrationStore> open(hal::DiskPort& disk);

  /// Good ones, newest first.
  const std::vector<Entry>& entries() const { return entries_; }
  /// What in_force() would be, were it to be taken back; nothing when there is none.
  const std::optional<Sha256>& in_force() const { return in_force_; }
  const std::optional<Sha256>& before() const { return before_; }
  /// One sentence about what was wrong at open(); empty when nothing was.
  const std::string& note() const { return note_; }

  /// Makes a calibration last, without putting it in force. One that is there already stays as it is; a signature that
  /// comes with it takes the place of the one before.
  Result<Entry> put(const Calibration& calibration, const std::optional<SignedDocument>& original = std::nullopt);
  /// What a stored one came with; nothing when that was no signature. Errors: kChecksum when it is damaged.
  Result<std::optional<SignedDocument>> original(const Sha256& id) const;
  /// Puts a stored one in force for the next start, and removes generations beyond kKept.
  Status set_in_force(const Sha256& id);
  /// Takes out one that is neither in force nor the one before.
  void remove(const Sha256& id);

  /// The one whose id begins with these bytes. Errors: kNotFound, kBadValue when several do.
  Result<Entry> find(std::string_view id_prefix) const;
  /// Its canonical form, checked against its id.
  Result<std::string> read(const Sha256& id) const;
  Result<Calibration> load(const Sha256& id) const;

 private:
  explicit CalibrationStore(hal::DiskPort& disk) : disk_(&disk) {}
  Status read_folder();
  void drop_copies();
  Result<std::string> read(const Entry& entry) const;
  Result<Calibration> load(const Entry& entry) const;
  void read_pointer();
  void drop_if_orphan(const std::string& file);
  const Entry* entry(const Sha256& id) const;
  Status write_pointer(const std::optional<Sha256>& in_force, const std::optional<Sha256>& before);
  void prune();
  void add_note(const std::string& sentence);

  hal::DiskPort* disk_;
  std::vector<Entry> entries_;
  std::vector<std::string> damaged_;  ///< and copies: files, the first to be removed
  std::optional<Sha256> in_force_;
  std::optional<Sha256> before_;
  std::uint64_t next_generation_ = 1;
  std::string note_;
};

}  // namespace nodal::firmware
