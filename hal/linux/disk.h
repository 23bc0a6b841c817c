// A DiskPort on a folder of the file system.
#pragma once

#include <map>
#include <memory>

#include "hal/disk.h"

namespace nodal::hal::linux_os {

/// Names are resolved under the root by openat2(RESOLVE_BENEATH), so that even a symbolic link cannot lead outside.
///
/// Threading: thread-bound to its stage.
/// Ownership: closes its files.
/// Errors: as DiskPort; kBadValue for a name with "..", an empty part or a leading "/".
class LinuxDisk final : public DiskPort {
 public:
  /// Creates the folder and its parents if they do not exist. Errors: kIo, naming the folder.
  static Result<std::unique_ptr<LinuxDisk>> open(const std::string& root);
  ~LinuxDisk() override;
  LinuxDisk(const LinuxDisk&) = delete;
  LinuxDisk& operator=(const LinuxDisk&) = delete;

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
  Status remove(const std::string& name) override;
  Status make_folder(const std::string& name) override;
  Status sync_folder(const std::string& name) override;
  Result<std::vector<std::string>> list(const std::string& folder) override;
  Result<std::uint64_t> free_bytes() override;
  Result<std::uint64_t> total_bytes() override;

 private:
  struct File {
    int descriptor = -1;
    std::string name;
    bool to_read = false;      ///< opened for reading, else for appending
    std::uint64_t end = 0;     ///< where the next byte is appended
    std::uint64_t let_go = 0;  ///< bytes before it are not kept in memory
  };
  /// Of what was appended to a file last: more than is written out at any time, as TakeKeeper syncs twice a second.
  static constexpr std::uint64_t kKeptInMemory = std::uint64_t{8} << 20;
  LinuxDisk(int root, std::string path) : root_(root), path_(std::move(path)) {}
  /// Opens a descriptor beneath the root; -1 with errno on failure.
  int open_beneath(const std::string& name, int flags) const;
  Result<FileHandle> open_file(const std::string& name, int flags);
  Result<File*> file_of(FileHandle handle, bool to_read);
  Error failure(const char* what, const std::string& name, int error) const;

  const int root_;
  const std::string path_;
  std::map<FileHandle, File> files_;
  FileHandle next_ = 1;
};

}  // namespace nodal::hal::linux_os
