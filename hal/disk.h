#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::hal {

using FileHandle = std::uint32_t;

enum class EntryKind : std::uint8_t { kFile, kFolder, kOther };

/// A direct entry of a folder.
struct FolderEntry {
  std::string name;
  EntryKind kind = EntryKind::kOther;  ///< kOther: a symbolic link, a device, a pipe
  /// A number that changes when the entry is replaced and, if it is a folder, when an entry in it is made, renamed or
  /// removed.
  std::uint64_t version = 0;
  friend bool operator==(const FolderEntry&, const FolderEntry&) = default;
};

/// A folder whose files survive power loss as far as they were synced. Names are relative to the folder, with "/"
/// between parts, never "..". Data that is not synced may be missing or incomplete after a crash. Symbolic links are
/// never followed, and only regular files are opened. What exists is written over by rename() alone, which replaces a
/// file as a whole.
///
/// The folder may be on a disk that people take out and exchange. Between claim() and release() every call concerns the
/// folder that had its name at claim(); without a claim, each call concerns the one that has it now, and nothing stays
/// open but handles.
///
/// Threading: thread-bound to its stage.
/// Ownership: handles are closed by close() or with the port.
/// Errors: kNotFound, kExists, kDiskFull, kIo, kDeviceGone; each names the file. kNotReady if no disk is mounted where
///   one is demanded. kWrongState for a handle that is not open. kBadValue for a name that leads through a symbolic
///   link.
class DiskPort {
 public:
  virtual ~DiskPort() = default;
  /// Reserves the folder for this port: no other port can claim it, in this program or another. Without effect if this
  /// port has claimed it.
  /// Errors: kBusy if it is claimed already.
  virtual Status claim() = 0;
  /// Gives the folder up. What was written stays. Without a claim, nothing changes.
  virtual void release() = 0;
  /// A number that identifies the folder that has this name now, also during a claim, to notice an exchanged disk.
  virtual Result<std::uint64_t> identity() = 0;

  /// Creates an empty file and opens it for appending. kExists if there is anything of that name.
  virtual Result<FileHandle> create(const std::string& name) = 0;
  /// Opens an existing file for appending. kBadValue if the file has other names, too (hard links), whose bytes would
  /// change.
  virtual Result<FileHandle> open_append(const std::string& name) = 0;
  /// Opens an existing file for reading at any offset. kIo if it is not a regular file.
  virtual Result<FileHandle> open_read(const std::string& name) = 0;
  /// Reads bytes from `offset` on and returns their number: less than `bytes` has only at the file's end, 0 at or after
  /// its end. The file may grow or shrink between calls. kWrongState for a handle of create() or open_append().
  virtual Result<std::size_t> read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) = 0;
  /// Writes all bytes, or fails; after kDiskFull a part may be written. kWrongState for a handle of open_read().
  virtual Status write(FileHandle file, std::span<const std::uint8_t> bytes) = 0;
  /// Appends the pieces one after the other, as one write() of all of them.
  virtual Status write_pieces(FileHandle file, std::span<const std::span<const std::uint8_t>> pieces) = 0;
  /// Replaces bytes that the file has. kBadValue if it has not all of them, or if they are not within one kSector: a
  /// power failure leaves a sector's old bytes or its new ones. Appending goes on at the file's end.
  virtual Status overwrite(FileHandle file, std::uint64_t offset, std::span<const std::uint8_t> bytes) = 0;
  /// Shortens a file that is open for appending. kBadValue if it is shorter than `size`.
  virtual Status truncate(FileHandle file, std::uint64_t size) = 0;
  /// Asks the disk to begin writing what was appended, without waiting for it: less is left for sync(). What was
  /// appended long before is no longer kept in memory, because a recording is not read again soon.
  virtual void start_write_out(FileHandle file) = 0;
  /// Asks for room behind the end of a file that is open for appending, which keeps its length, so that it lies in one
  /// piece. A file system that cannot do it, or has no room, does nothing. truncate() gives back what was not used.
  virtual void preallocate(FileHandle file, std::uint64_t bytes) = 0;
  virtual Status sync(FileHandle file) = 0;
  /// Makes every change of every file and folder durable. After an error it is unknown what is durable.
  virtual Status sync_all() = 0;
  virtual void close(FileHandle file) = 0;

  virtual Result<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t limit_bytes) = 0;
  virtual Result<std::uint64_t> size(const std::string& name) = 0;
  /// Replaces `to` atomically.
  virtual Status rename(const std::string& from, const std::string& to) = 0;
  /// kExists if there is anything named `to`, which then stays.
  virtual Status rename_new(const std::string& from, const std::string& to) = 0;
  /// Removes a file, an empty folder, or a symbolic link, not what the link leads to.
  virtual Status remove(const std::string& name) = 0;
  /// kExists if there is anything of that name.
  virtual Status make_folder(const std::string& name) = 0;
  /// Makes creations, renames and removals in the folder durable; "" is the root.
  virtual Status sync_folder(const std::string& name) = 0;
  /// Names of the direct entries, sorted.
  virtual Result<std::vector<std::string>> list(const std::string& folder) = 0;
  /// The same with what they are, sorted by name; "" is the root. Both: kTooLarge for a folder that exceeds
  /// FolderListing's limits.
  virtual Result<std::vector<FolderEntry>> entries(const std::string& folder) = 0;
  virtual Result<std::uint64_t> free_bytes() = 0;
  virtual Result<std::uint64_t> total_bytes() = 0;

  static constexpr std::uint64_t kSector = 512;
};

}  // namespace nodal::hal
