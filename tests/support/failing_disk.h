// A disk of which one call fails, by its number: an open, a read or a look at names.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "hal/sim/disk.h"

namespace nodal::test {

/// Only calls that read are counted; SimDisk::fail_at() is for those that change something.
///
/// Threading: thread-bound.
/// Ownership: the disk outlives it.
/// Errors: as SimDisk; kIo, naming the file, for the call that fails.
class FailingDisk final : public hal::DiskPort {
 public:
  FailingDisk(hal::sim::SimDisk& disk, std::uint64_t fails_at) : disk_(disk), fails_at_(fails_at) {}
  /// Reading calls so far.
  std::uint64_t calls() const { return calls_; }
  /// What the call that failed concerned.
  const std::string& failed() const { return failed_; }

  Status claim() override { return disk_.claim(); }
  void release() override { disk_.release(); }
  Result<std::uint64_t> identity() override { return disk_.identity(); }
  Result<hal::FileHandle> create(const std::string& name) override { return disk_.create(name); }
  Result<hal::FileHandle> open_append(const std::string& name) override {
    return reading(name, [&] { return disk_.open_append(name); });
  }
  Result<hal::FileHandle> open_read(const std::string& name) override {
    auto opened = reading(name, [&] { return disk_.open_read(name); });
    if (opened) names_[*opened] = name;
    return opened;
  }
  Result<std::size_t> read_at(hal::FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) override {
    return reading(names_[file], [&] { return disk_.read_at(file, offset, bytes); });
  }
  Status write(hal::FileHandle file, std::span<const std::uint8_t> bytes) override { return disk_.write(file, bytes); }
  Status write_pieces(hal::FileHandle file, std::span<const std::span<const std::uint8_t>> pieces) override {
    return disk_.write_pieces(file, pieces);
  }
  Status overwrite(hal::FileHandle file, std::uint64_t offset, std::span<const std::uint8_t> bytes) override {
    return disk_.overwrite(file, offset, bytes);
  }
  Status truncate(hal::FileHandle file, std::uint64_t size) override { return disk_.truncate(file, size); }
  void start_write_out(hal::FileHandle file) override { disk_.start_write_out(file); }
  void preallocate(hal::FileHandle file, std::uint64_t bytes) override { disk_.preallocate(file, bytes); }
  Status sync(hal::FileHandle file) override { return disk_.sync(file); }
  Status sync_all() override { return disk_.sync_all(); }
  void close(hal::FileHandle file) override { disk_.close(file); }
  Result<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t limit_bytes) override {
    return reading(name, [&] { return disk_.read(name, limit_bytes); });
  }
  Result<std::uint64_t> size(const std::string& name) override {
    return reading(name, [&] { return disk_.size(name); });
  }
  Status rename(const std::string& from, const std::string& to) override { return disk_.rename(from, to); }
  Status rename_new(const std::string& from, const std::string& to) override { return disk_.rename_new(from, to); }
  Status remove(const std::string& name) override { return disk_.remove(name); }
  Status make_folder(const std::string& name) override { return disk_.make_folder(name); }
  Status sync_folder(const std::string& name) override { return disk_.sync_folder(name); }
  Result<std::vector<std::string>> list(const std::string& folder) override {
    return reading(folder, [&] { return disk_.list(folder); });
  }
  Result<std::vector<hal::FolderEntry>> entries(const std::string& folder) override {
    return reading(folder, [&] { return disk_.entries(folder); });
  }
  Result<std::uint64_t> free_bytes() override { return disk_.free_bytes(); }
  Result<std::uint64_t> total_bytes() override { return disk_.total_bytes(); }

 private:
  template <class Call>
  auto reading(const std::string& name, Call call) -> decltype(call()) {
    if (calls_++ != fails_at_) return call();
    failed_ = name;
    return fail(Errc::kIo, "file '" + name + "': reading it failed: the disk reports an error");
  }

  hal::sim::SimDisk& disk_;
  const std::uint64_t fails_at_;
  std::uint64_t calls_ = 0;
  std::string failed_;
  std::map<hal::FileHandle, std::string> names_;
};

}  // namespace nodal::test
