// The disks that every test of a DiskPort runs on. To add an implementation: add a DiskWorld.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "hal/disk.h"
#include "hal/folder_listing.h"
#include "hal/linux/disk.h"
#include "hal/sim/card_slot.h"
#include "hal/sim/disk.h"
#include "tests/support/pictures.h"

namespace nodal::hal {

class DiskWorld {
 public:
  virtual ~DiskWorld() = default;
  virtual DiskPort& disk() = 0;
  /// Another port for the same folder, as of a second program.
  virtual std::unique_ptr<DiskPort> other() = 0;
  /// Puts another folder in its place, as when a card is exchanged.
  virtual void exchange() = 0;
  virtual void make_link(const std::string& target, const std::string& name) = 0;
  virtual void make_second_name(const std::string& file, const std::string& name) = 0;
};

struct DiskWorldKind {
  std::string name;
  std::function<std::unique_ptr<DiskWorld>()> make;
  friend std::ostream& operator<<(std::ostream& out, const DiskWorldKind& kind) { return out << kind.name; }
};

inline std::vector<std::uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

class DiskTestOfEvery : public testing::TestWithParam<DiskWorldKind> {
 protected:
  DiskPort& disk() { return world_->disk(); }
  void put(const std::string& name, const std::string& text) {
    const auto file = disk().create(name);
    ASSERT_TRUE(file) << file.error().text();
    ASSERT_TRUE(disk().write(*file, bytes_of(text)));
    ASSERT_TRUE(disk().sync(*file));
    disk().close(*file);
  }
  std::string get(const std::string& name) {
    const auto bytes = disk().read(name, 1 << 20);
    return bytes ? std::string(bytes->begin(), bytes->end()) : bytes.error().text();
  }
  using Names = std::vector<std::string>;

  std::unique_ptr<DiskWorld> world_ = GetParam().make();
};

template <class T>
void expect_error(const Result<T>& result, Errc code, const std::string& name) {
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, code) << result.error().text();
  EXPECT_NE(result.error().message.find(name), std::string::npos) << result.error().message;
}

class SimDiskWorld final : public DiskWorld {
 public:
  SimDiskWorld() { slot_.insert(std::make_shared<sim::SimDisk>(1)); }
  DiskPort& disk() override { return *port_; }
  std::unique_ptr<DiskPort> other() override { return slot_.port(); }
  void exchange() override { slot_.insert(std::make_shared<sim::SimDisk>(2)); }
  void make_link(const std::string&, const std::string& name) override { slot_.disk()->put_link(name); }
  void make_second_name(const std::string& file, const std::string& name) override {
    slot_.disk()->put_second_name(file, name);
  }

 private:
  sim::SimCardSlot slot_;
  std::unique_ptr<DiskPort> port_ = slot_.port();
};

class LinuxDiskWorld final : public DiskWorld {
 public:
  LinuxDiskWorld() { EXPECT_TRUE(disk_->free_bytes()) << "makes the folder"; }
  DiskPort& disk() override { return *disk_; }
  std::unique_ptr<DiskPort> other() override { return linux_os::LinuxDisk::guest(path_, false); }
  void exchange() override {
    std::filesystem::rename(path_, path_ + "-taken-out");
    std::filesystem::create_directory(path_);
  }
  void make_link(const std::string& target, const std::string& name) override {
    std::filesystem::create_symlink(target, path_ + "/" + name);
  }
  void make_second_name(const std::string& file, const std::string& name) override {
    std::filesystem::create_hard_link(path_ + "/" + file, path_ + "/" + name);
  }

 private:
  test::TemporaryFolder folder_;
  const std::string path_ = (folder_ / "made/on/the/way").string();
  std::unique_ptr<DiskPort> disk_ = linux_os::LinuxDisk::guest(path_, false);
};

inline auto every_disk() {
  return testing::Values(DiskWorldKind{"Sim", [] { return std::make_unique<SimDiskWorld>(); }},
                         DiskWorldKind{"Linux", [] { return std::make_unique<LinuxDiskWorld>(); }});
}

}  // namespace nodal::hal
