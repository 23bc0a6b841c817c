#include "logged_disk.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/dm-ioctl.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <utility>

#include "tests/support/process.h"

namespace nodal::hil {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kSectorBytes = 512;
// Numbers of drivers/md/dm-log-writes.c.
constexpr std::uint64_t kMagic = 0x6a736677736872ULL;
constexpr std::uint64_t kFlush = 1, kFua = 2, kDiscard = 4, kMark = 8;
constexpr const char* kMapped = "logged";
constexpr const char* kEndMark = "dm-log-writes-end";  // the target's own, when it is removed

/// The command's output without its last line end; a failure of the test if it fails.
std::string run(const std::vector<std::string>& command) {
  test::Finished done = test::Process(command).wait();
  EXPECT_EQ(done.code, 0) << command[0] << ": " << done.out << done.err;
  while (done.out.ends_with('\n')) done.out.pop_back();
  return done.out;
}

}  // namespace

std::optional<WriteLog> WriteLog::read(const std::string& file) {
  struct Super {
    std::uint64_t magic, version, entries;
    std::uint32_t sector_bytes;
  } super{};
  std::ifstream in(file, std::ios::binary);
  in.read(reinterpret_cast<char*>(&super), sizeof super);
  EXPECT_TRUE(in.good() && super.magic == kMagic && super.version == 1 && super.sector_bytes == kSectorBytes) << file;
  if (super.magic != kMagic) return std::nullopt;
  WriteLog log;
  log.file_ = file;
  std::uint64_t at = kSectorBytes;
  for (std::uint64_t k = 0; k < super.entries; ++k) {
    char sector[kSectorBytes];
    in.seekg(static_cast<std::streamoff>(at));
    in.read(sector, sizeof sector);
    EXPECT_TRUE(in.good()) << "entry " << k << " of " << super.entries;
    if (!in.good()) return std::nullopt;
    std::uint64_t words[4];
    std::memcpy(words, sector, sizeof words);
    at += kSectorBytes;
    Entry& entry = log.entries_.emplace_back(Entry{words[0], words[1], words[2], at, {}});
    if ((entry.flags & kMark) != 0) entry.mark.assign(sector + sizeof words, std::min<std::uint64_t>(words[3], 400));
    while (entry.mark.ends_with('\0')) entry.mark.pop_back();
    if (entry.mark == kEndMark) {
      log.entries_.pop_back();
      break;
    }
    if ((entry.flags & (kDiscard | kMark)) == 0) at += entry.sectors * kSectorBytes;
  }
  return log;
}

const std::string& WriteLog::mark_before(std::size_t count) const {
  static const std::string none;
  for (std::size_t k = count; k-- > 0;) {
    if ((entries_[k].flags & kMark) != 0) return entries_[k].mark;
  }
  return none;
}

std::size_t WriteLog::flushes() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(entries_, [](const Entry& entry) { return (entry.flags & kFlush) != 0; }));
}

void WriteLog::replay(const std::string& image, std::size_t count, std::uint64_t seed) const {
  std::ifstream in(file_, std::ios::binary);
  std::fstream out(image, std::ios::binary | std::ios::in | std::ios::out);
  std::mt19937_64 random(seed);
  std::size_t flushed = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if ((entries_[k].flags & kFlush) != 0) flushed = k;
  }
  std::vector<char> bytes;
  for (std::size_t k = 0; k < count; ++k) {
    const Entry& entry = entries_[k];
    if (entry.sectors == 0 || (entry.flags & kMark) != 0) continue;
    const bool may_be_lost = k > flushed && (entry.flags & kFua) == 0;
    const std::uint64_t fate = may_be_lost ? random() % 4 : 0;
    if (fate == 1 || fate == 2) continue;
    bytes.assign(entry.sectors * kSectorBytes, 0);
    if ((entry.flags & kDiscard) == 0) {
      in.seekg(static_cast<std::streamoff>(entry.data_at));
      in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    }
    for (std::uint64_t sector = 0; sector < entry.sectors; ++sector) {
      if (fate == 3 && random() % 2 == 0) continue;
      out.seekp(static_cast<std::streamoff>((entry.sector + sector) * kSectorBytes));
      out.write(bytes.data() + sector * kSectorBytes, static_cast<std::streamsize>(kSectorBytes));
    }
  }
  out.flush();
  EXPECT_TRUE(in.good() && out.good()) << image;
}

LoggedDisk::LoggedDisk(std::string folder, std::vector<std::string> make, std::string type, std::uint64_t megabytes)
    : folder_(std::move(folder)), type_(std::move(type)) {
  fs::create_directories(folder_ + "/mounted");
  for (const char* name : {"data", "log"}) {
    std::ofstream(image(name)).close();
    fs::resize_file(image(name), megabytes << 20U);
  }
  make.push_back(image("data"));
  run(make);
  run({"cp", "--sparse=always", image("data"), image("empty")});
}

LoggedDisk::~LoggedDisk() {
  unmount();
  remove_log_device();
  fs::remove_all(folder_);
}

std::string LoggedDisk::begin_log() {
  for (const char* name : {"data", "log"}) loops_.push_back(run({"losetup", "--find", "--show", image(name)}));
  const std::uint64_t sectors = fs::file_size(image("data")) / kSectorBytes;
  run({"dmsetup", "create", "--noudevsync", kMapped, "--table",
       "0 " + std::to_string(sectors) + " log-writes " + loops_[0] + " " + loops_[1]});
  run({"dmsetup", "mknodes"});
  log_device_ = std::string("/dev/mapper/") + kMapped;
  EXPECT_TRUE(mount(log_device_));
  return folder_ + "/mounted";
}

void LoggedDisk::mark(const std::string& text) {
  // What "dmsetup message logged 0 mark TEXT" does; a process each time would take most of a test's time.
  struct {
    dm_ioctl request;
    std::uint64_t sector;
    char text[64];
  } message{};
  message.request.version[0] = DM_VERSION_MAJOR;
  message.request.data_size = sizeof message;
  message.request.data_start = sizeof(dm_ioctl);
  std::strncpy(message.request.name, kMapped, sizeof message.request.name - 1);
  std::strncpy(message.text, ("mark " + text).c_str(), sizeof message.text - 1);
  const int control = open("/dev/mapper/control", O_RDWR | O_CLOEXEC);
  EXPECT_EQ(ioctl(control, DM_TARGET_MSG, &message), 0) << std::strerror(errno);
  close(control);
}

std::optional<WriteLog> LoggedDisk::end_log() {
  unmount();
  remove_log_device();
  return WriteLog::read(image("log"));
}

void LoggedDisk::remove_log_device() {
  if (std::exchange(log_device_, {}).empty()) return;
  run({"dmsetup", "remove", "--noudevsync", kMapped});
  detach_loops();
}

void LoggedDisk::detach_loops() {
  for (const std::string& loop : std::exchange(loops_, {})) run({"losetup", "--detach", loop});
}

std::optional<std::string> LoggedDisk::mount_after_cut(const WriteLog& log, std::size_t count, std::uint64_t seed) {
  run({"cp", "--sparse=always", image("empty"), image("cut")});
  log.replay(image("cut"), count, seed);
  loops_.push_back(run({"losetup", "--find", "--show", image("cut")}));
  if (type_ == "exfat") {  // it has no journal: the boot checks it, and a 1 says that there was something to repair
    const int checked = test::Process({"fsck.exfat", "-y", loops_.back()}).wait().code;
    EXPECT_TRUE(checked == 0 || checked == 1) << checked;
  }
  if (!mount(loops_.back())) return std::nullopt;
  return folder_ + "/mounted";
}

bool LoggedDisk::mount(const std::string& device) {
  mounted_ = ::mount(device.c_str(), (folder_ + "/mounted").c_str(), type_.c_str(), MS_NOATIME, nullptr) == 0;
  EXPECT_TRUE(mounted_) << "mount " << device << " as " << type_ << ": " << std::strerror(errno);
  return mounted_;
}

void LoggedDisk::unmount() {
  if (mounted_) {
    EXPECT_EQ(umount((folder_ + "/mounted").c_str()), 0) << std::strerror(errno);
    mounted_ = false;
  }
  if (log_device_.empty()) detach_loops();
}

}  // namespace nodal::hil
