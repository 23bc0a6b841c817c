#include "hal/sim/card_slot.h"

#include <fmt/format.h>

#include "protocol/base/try.h"

namespace nodal::hal::sim {

class SimCardSlot::Port final : public DiskPort {
 public:
  explicit Port(std::shared_ptr<Place> place) : place_(std::move(place)) {}
  ~Port() override {
    for (const auto& [handle, file] : files_) file.disk->close(file.handle);
    release();
  }

  Status claim() override {
    if (claimed_) return {};
    if (!place_->disk) return fail(empty());
    NODAL_TRY(place_->disk->claim_for(this));
    claimed_ = place_->disk;
    return {};
  }
  void release() override {
    if (claimed_) claimed_->release_for(this);
    claimed_.reset();
  }
  Result<std::uint64_t> identity() override {
    if (!place_->disk) return fail(empty());
    return place_->disk->identity();
  }

  Result<FileHandle> create(const std::string& name) override { return opened(&DiskPort::create, name); }
  Result<FileHandle> open_append(const std::string& name) override { return opened(&DiskPort::open_append, name); }
  Result<FileHandle> open_read(const std::string& name) override { return opened(&DiskPort::open_read, name); }
  Result<std::size_t> read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) override {
    return with(file, [&](File& of) { return of.disk->read_at(of.handle, offset, bytes); });
  }
  Status write(FileHandle file, std::span<const std::uint8_t> bytes) override {
    return with(file, [&](File& of) { return of.disk->write(of.handle, bytes); });
  }
  Status write_pieces(FileHandle file, std::span<const std::span<const std::uint8_t>> pieces) override {
    return with(file, [&](File& of) { return of.disk->write_pieces(of.handle, pieces); });
  }
  Status overwrite(FileHandle file, std::uint64_t offset, std::span<const std::uint8_t> bytes) override {
    return with(file, [&](File& of) { return of.disk->overwrite(of.handle, offset, bytes); });
  }
  Status truncate(FileHandle file, std::uint64_t size) override {
    return with(file, [&](File& of) { return of.disk->truncate(of.handle, size); });
  }
  void start_write_out(FileHandle) override {}
  void preallocate(FileHandle, std::uint64_t) override {}
  Status sync(FileHandle file) override {
    return with(file, [&](File& of) { return of.disk->sync(of.handle); });
  }
  Status sync_all() override {
    return on_disk([](SimDisk& disk) { return disk.sync_all(); });
  }
  void close(FileHandle file) override {
    const auto found = files_.find(file);
    if (found == files_.end()) return;
    found->second.disk->close(found->second.handle);
    files_.erase(found);
  }
  Result<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t limit_bytes) override {
    return on_disk([&](SimDisk& disk) { return disk.read(name, limit_bytes); });
  }
  Result<std::uint64_t> size(const std::string& name) override {
    return on_disk([&](SimDisk& disk) { return disk.size(name); });
  }
  Status rename(const std::string& from, const std::string& to) override {
    return on_disk([&](SimDisk& disk) { return disk.rename(from, to); });
  }
  Status rename_new(const std::string& from, const std::string& to) override {
    return on_disk([&](SimDisk& disk) { return disk.rename_new(from, to); });
  }
  Status remove(const std::string& name) override {
    return on_disk([&](SimDisk& disk) { return disk.remove(name); });
  }
  Status make_folder(const std::string& name) override {
    return on_disk([&](SimDisk& disk) { return disk.make_folder(name); });
  }
  Status sync_folder(const std::string& name) override {
    return on_disk([&](SimDisk& disk) { return disk.sync_folder(name); });
  }
  Result<std::vector<std::string>> list(const std::string& folder) override {
    return on_disk([&](SimDisk& disk) { return disk.list(folder); });
  }
  Result<std::vector<FolderEntry>> entries(const std::string& folder) override {
    return on_disk([&](SimDisk& disk) { return disk.entries(folder); });
  }
  Result<std::uint64_t> free_bytes() override {
    return on_disk([](SimDisk& disk) { return disk.free_bytes(); });
  }
  Result<std::uint64_t> total_bytes() override {
    return on_disk([](SimDisk& disk) { return disk.total_bytes(); });
  }

 private:
  struct File {
    std::shared_ptr<SimDisk> disk;
    FileHandle handle = 0;
  };
  static Error empty() { return {Errc::kNotReady, "folder '': no disk is mounted there; mount the card"}; }
  template <class Call>
  auto on_disk(Call call) -> decltype(call(std::declval<SimDisk&>())) {
    const std::shared_ptr<SimDisk> disk = claimed_ ? claimed_ : place_->disk;
    if (!disk) return fail(empty());
    return call(*disk);
  }
  template <class Call>
  auto with(FileHandle file, Call call) -> decltype(call(std::declval<File&>())) {
    const auto found = files_.find(file);
    if (found == files_.end()) return fail(Errc::kWrongState, fmt::format("file handle {}: is not open", file));
    return call(found->second);
  }
  Result<FileHandle> opened(Result<FileHandle> (DiskPort::*open)(const std::string&), const std::string& name) {
    const std::shared_ptr<SimDisk> disk = claimed_ ? claimed_ : place_->disk;
    if (!disk) return fail(empty());
    NODAL_TRY_ASSIGN(const auto handle, ((*disk).*open)(name));
    files_[next_] = {disk, handle};
    return next_++;
  }

  const std::shared_ptr<Place> place_;
  std::shared_ptr<SimDisk> claimed_;
  std::map<FileHandle, File> files_;
  FileHandle next_ = 1;
};

std::unique_ptr<DiskPort> SimCardSlot::port() const { return std::make_unique<Port>(place_); }

void SimCardSlot::pull() {
  if (place_->disk) place_->disk->unplug();
  place_->disk.reset();
}

}  // namespace nodal::hal::sim
