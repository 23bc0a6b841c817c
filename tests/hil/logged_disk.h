// A disk with a file system whose writes are recorded in order, so that a test can see what it holds after a power cut.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace nodal::hil {

/// The writes of a disk in the order in which they reached it: the log of the kernel's dm-log-writes
/// (Documentation/admin-guide/device-mapper/log-writes.rst). Writes that were complete before a flush come before it.
class WriteLog {
 public:
  /// `file` is the log's device or image. Nothing, and a failure of the test, if it is no such log.
  static std::optional<WriteLog> read(const std::string& file);

  std::size_t size() const { return entries_.size(); }
  /// The newest mark among the first `count` entries; "" if there is none.
  const std::string& mark_before(std::size_t count) const;
  /// Number of flushes among all entries.
  std::size_t flushes() const;
  /// Writes to the image what the disk holds if the power fails after `count` entries. Everything before the newest
  /// flush is there; each sector of what was written later is there or not, as `seed` says: by whole writes, and some
  /// writes in part.
  void replay(const std::string& image, std::size_t count, std::uint64_t seed) const;

 private:
  struct Entry {
    std::uint64_t sector = 0;
    std::uint64_t sectors = 0;
    std::uint64_t flags = 0;
    std::uint64_t data_at = 0;  ///< position of its first byte in the log
    std::string mark;
  };
  std::string file_;
  std::vector<Entry> entries_;
};

/// A folder with a file system on a disk in memory.
class LoggedDisk {
 public:
  /// `make` makes the file system of the device whose name is added to it. Failures are the test's.
  LoggedDisk(std::string folder, std::vector<std::string> make, std::string type, std::uint64_t megabytes);
  /// The images go, too.
  ~LoggedDisk();
  LoggedDisk(const LoggedDisk&) = delete;
  LoggedDisk& operator=(const LoggedDisk&) = delete;

  /// Mounts it with a log of its writes. Returns the mounted folder.
  std::string begin_log();
  /// At most 50 characters.
  void mark(const std::string& text);
  /// Unmounts and returns what was written since begin_log().
  std::optional<WriteLog> end_log();
  /// Mounts the disk as the power cut left it (WriteLog::replay()), exFAT after its check, and returns the mounted
  /// folder. Ends with unmount().
  std::optional<std::string> mount_after_cut(const WriteLog& log, std::size_t count, std::uint64_t seed);
  void unmount();

 private:
  bool mount(const std::string& device);
  void remove_log_device();
  void detach_loops();
  std::string image(const char* name) const { return folder_ + "/" + name + ".img"; }

  const std::string folder_;
  const std::string type_;
  std::string log_device_;
  std::vector<std::string> loops_;
  bool mounted_ = false;
};

}  // namespace nodal::hil
