// A DiskPort on a folder of the file system.
#pragma once

#include <map>
#include <memory>

#include "hal/disk.h"
#include "hal/linux/disk_parts.h"

namespace nodal::hal::linux_os {

/// Names are resolved under the root by openat2(RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS). claim() locks the file
/// kLockFile, which it makes in the root; the kernel unlocks it when the process ends, however it does.
///
/// Threading: thread-bound to its stage.
/// Ownership: closes its files.
/// Errors: as DiskPort; kBadValue for a name with "..", an empty part or a leading "/".
class LinuxDisk final : public DiskPort {
 public:
  /// Stays open. Creates the folder and its parents if they do not exist. Errors: kIo, naming the folder.
  static Result<std::unique_ptr<LinuxDisk>> open(const std::string& root);
  /// For a disk that may be exchanged: without a claim, the folder is opened for each call, so that it can be
  /// unmounted. `mounted`: it must be the root of a mounted file system, else every call fails with kNotReady;
  /// otherwise it is made when it is not there.
  static std::unique_ptr<LinuxDisk> guest(const std::string& root, bool mounted);
  ~LinuxDisk() override;
  LinuxDisk(const LinuxDisk&) = delete;
  LinuxDisk& operator=(const LinuxDisk&) = delete;

  Status claim() override;
  void release() override;
  Result<std::uint64_t> identity() override;
  Result<FileHandle> create(const std::string& name) override;
  Result<FileHandle> open_append(const std::string& name) override;
  Result<FileHandle> open_read(const std::string& name) override;
  Result<std::size_t> read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) override;
  Status write(FileHandle file, std::span<const std::uint8_t> bytes) override;
  Status write_pieces(FileHandle file, std::span<const std::span<const std::uint8_t>> pieces) override;
  Status overwrite(FileHandle file, std::uint64_t offset, std::span<const std::uint8_t> bytes) override;
  Status truncate(FileHandle file, std::uint64_t size) override;
  void start_write_out(FileHandle file) override;
  void preallocate(FileHandle file, std::uint64_t bytes) override;
  Status sync(FileHandle file) override;
  Status sync_all() override;
  void close(FileHandle file) override;
  Result<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t limit_bytes) override;
  Result<std::uint64_t> size(const std::string& name) override;
  Status rename(const std::string& from, const std::string& to) override;
  Status rename_new(const std::string& from, const std::string& to) override;
  Status remove(const std::string& name) override;
  Status make_folder(const std::string& name) override;
  Status sync_folder(const std::string& name) override;
  Result<std::vector<std::string>> list(const std::string& folder) override;
  Result<std::vector<FolderEntry>> entries(const std::string& folder) override;
  Result<std::uint64_t> free_bytes() override;
  Result<std::uint64_t> total_bytes() override;

  static const std::string kLockFile;

 private:
  struct File {
    Descriptor descriptor;
    std::string name;
    bool to_read = false;      ///< opened for reading, else for appending
    std::uint64_t end = 0;     ///< where the next byte is appended
    std::uint64_t let_go = 0;  ///< bytes before it are not kept in memory
  };
  /// Bytes appended last to a file that stay cached: more than is unwritten at any time, as TakeKeeper syncs twice a
  /// second.
  static constexpr std::uint64_t kKeptInMemory = std::uint64_t{8} << 20;
  /// The root for one call: that of the claim, or one that is closed after the call.
  struct Root {
    int number;
    Descriptor own;
    int get() const { return number; }
  };
  LinuxDisk(std::string path, bool mounted) : path_(std::move(path)), mounted_(mounted) {}
  Result<Descriptor> open_root() const;
  Result<Root> folder() const;
  Error not_mounted() const;
  /// `what`: is done, for the error.
  Result<Descriptor> open_beneath(const std::string& name, int flags, const char* what) const;
  Status rename_as(const std::string& from, const std::string& to, unsigned flags);
  Result<FileHandle> open_file(const std::string& name, int flags);
  Result<File*> file_of(FileHandle handle, bool to_read);
  Error failure(const char* what, const std::string& name, int error) const;

  const std::string path_;
  const bool mounted_;
  bool guest_ = false;
  bool may_make_ = false;
  Descriptor root_;  ///< the folder; a guest opens it only during a claim
  Descriptor lock_;  ///< during a claim
  std::map<FileHandle, File> files_;
  FileHandle next_ = 1;
};

}  // namespace nodal::hal::linux_os
