// Tests that need a real file system.
#include "hal/linux/disk.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/magic.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <thread>

#include "tests/support/pictures.h"

namespace nodal::hal::linux_os {
namespace {

const std::vector<std::uint8_t> kBytes{'x', 'y'};

TEST(LinuxDisk, NoRoom_IsDiskFullAndNamesTheFile) {
  const test::TemporaryFolder folder;
  if (::mount("small", folder.path().c_str(), "tmpfs", 0, "size=64k") != 0) GTEST_SKIP() << "mounting needs root";
  {
    auto disk = LinuxDisk::open(folder.path().string()).value();
    const auto file = disk->create("film");
    EXPECT_TRUE(file);
    const Status status = file ? disk->write(*file, std::vector<std::uint8_t>(1 << 20)) : Status();
    EXPECT_FALSE(status);
    if (!status) {
      EXPECT_EQ(status.error().code, Errc::kDiskFull);
      EXPECT_NE(status.error().message.find("/film"), std::string::npos);
    }
  }
  EXPECT_EQ(::umount(folder.path().c_str()), 0);
}

TEST(LinuxDisk, ADevice_IsNoFile) {
  auto disk = LinuxDisk::open("/dev").value();
  EXPECT_EQ(disk->open_append("null").error().code, Errc::kIo);
  EXPECT_EQ(disk->open_read("null").error().code, Errc::kIo);
}

TEST(LinuxDisk, RoomBehindTheEnd_IsTakenAndGivenBackByTruncate) {
  const test::TemporaryFolder folder;
  auto disk = LinuxDisk::open(folder.path().string()).value();
  const FileHandle file = disk->create("film").value();
  const auto blocks = [&] {
    struct stat about {};
    EXPECT_EQ(::stat((folder / "film").c_str(), &about), 0);
    return about.st_blocks * 512;
  };
  ASSERT_TRUE(disk->write(file, kBytes));
  disk->preallocate(file, 1 << 20);
  if (blocks() < 1 << 20) GTEST_SKIP() << "this file system gives no room";
  EXPECT_EQ(disk->size("film").value_or(0), kBytes.size());
  disk->preallocate(file, std::uint64_t{1} << 62);  // more than any disk has
  ASSERT_TRUE(disk->write(file, kBytes));
  ASSERT_TRUE(disk->truncate(file, 2 * kBytes.size()));
  EXPECT_LT(blocks(), 1 << 20);
  EXPECT_EQ(disk->read("film", 100).value(), (std::vector<std::uint8_t>{'x', 'y', 'x', 'y'}));
}

TEST(LinuxDisk, WhatWasWrittenOutLongAgo_IsNotKeptInMemory) {
  const test::TemporaryFolder folder;
  const auto disk = LinuxDisk::open(folder.path().string());
  ASSERT_TRUE(disk);
  const auto file = (*disk)->create("film");
  ASSERT_TRUE(file);
  constexpr std::size_t kLength = std::size_t{64} << 20;
  std::vector<std::uint8_t> mebibyte(1 << 20);
  for (std::size_t at = 0; at < kLength; at += mebibyte.size()) {
    std::ranges::fill(mebibyte, static_cast<std::uint8_t>(at >> 20));
    ASSERT_TRUE((*disk)->write(*file, mebibyte));
    ASSERT_TRUE((*disk)->sync(*file));
    (*disk)->start_write_out(*file);
  }
  const int descriptor = ::open((folder / "film").c_str(), O_RDONLY | O_CLOEXEC);
  void* const mapped = ::mmap(nullptr, kLength, PROT_READ, MAP_SHARED, descriptor, 0);
  ASSERT_NE(mapped, MAP_FAILED);
  std::vector<unsigned char> resident(kLength / static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)));
  ASSERT_EQ(::mincore(mapped, kLength, resident.data()), 0);
  ::munmap(mapped, kLength);
  struct statfs kind = {};
  ASSERT_EQ(::fstatfs(descriptor, &kind), 0);
  ::close(descriptor);
  if (kind.f_type == TMPFS_MAGIC) GTEST_SKIP() << "files of this file system are only in memory";
  const auto kept = std::ranges::count_if(resident, [](unsigned char page) { return (page & 1) != 0; });
  EXPECT_LE(static_cast<std::size_t>(kept), resident.size() / 4) << "16 MiB of 64";
  mebibyte.assign(mebibyte.size(), 0);
  const auto reading = (*disk)->open_read("film");
  ASSERT_TRUE(reading);
  for (std::size_t at = 0; at < kLength; at += mebibyte.size()) {
    ASSERT_EQ((*disk)->read_at(*reading, at, mebibyte).value_or(0), mebibyte.size());
    EXPECT_EQ(std::ranges::count(mebibyte, static_cast<std::uint8_t>(at >> 20)), 1 << 20);
  }
}

TEST(LinuxDisk, SymbolicLinkOutOfTheFolder_IsNotFollowed) {
  const test::TemporaryFolder folder;
  std::filesystem::create_directory(folder / "root");
  std::filesystem::create_directory(folder / "outside");
  test::write_bytes(folder / "outside/secret", kBytes);
  std::filesystem::create_symlink(folder / "outside", folder / "root/absolute");
  std::filesystem::create_symlink("../outside", folder / "root/relative");
  std::filesystem::create_symlink("../outside/secret", folder / "root/file");
  auto disk = LinuxDisk::open((folder / "root").string()).value();
  for (const std::string name : {"absolute/secret", "relative/secret", "file"}) {
    EXPECT_EQ(disk->read(name, 100).error().code, Errc::kBadValue) << name;
    EXPECT_EQ(disk->open_append(name).error().code, Errc::kBadValue) << name;
    EXPECT_FALSE(disk->create(name)) << name;
    EXPECT_EQ(disk->size(name).error().code, Errc::kBadValue) << name;
  }
  EXPECT_EQ(disk->remove("absolute/secret").error().code, Errc::kBadValue);
  EXPECT_EQ(disk->make_folder("relative/new").error().code, Errc::kBadValue);
  EXPECT_EQ(disk->list("absolute").error().code, Errc::kBadValue);
  EXPECT_EQ(test::read_bytes(folder / "outside/secret"), kBytes);
}

/// Descriptors of this process that lead into the folder.
int open_in(const std::filesystem::path& folder) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    const std::string to = std::filesystem::read_symlink(entry.path(), gone).string();
    count += !gone && to.starts_with(folder.string()) ? 1 : 0;
  }
  return count;
}

TEST(LinuxDisk, OfAGuest_NothingIsOpenButDuringAClaim) {
  const test::TemporaryFolder folder;
  const auto disk = LinuxDisk::guest(folder.path().string(), false);
  const auto file = disk->create("film");
  ASSERT_TRUE(file);
  ASSERT_TRUE(disk->write(*file, kBytes));
  disk->close(*file);
  ASSERT_TRUE(disk->read("film", 100) && disk->list("") && disk->free_bytes() && disk->identity() && disk->sync_all());
  EXPECT_EQ(open_in(folder.path()), 0);
  ASSERT_TRUE(disk->claim());
  EXPECT_GT(open_in(folder.path()), 0);
  disk->release();
  EXPECT_EQ(open_in(folder.path()), 0);
}

TEST(LinuxDisk, MountedIsDemandedAndNothingIs_EveryCallSaysSoAndMakesNothing) {
  const test::TemporaryFolder folder;
  for (const std::string name : {"", "/not/made"}) {
    const auto disk = LinuxDisk::guest(folder.path().string() + name, true);
    for (const Errc code : {disk->claim().error().code, disk->identity().error().code, disk->create("a").error().code,
                            disk->list("").error().code, disk->free_bytes().error().code}) {
      EXPECT_EQ(code, Errc::kNotReady);
    }
    EXPECT_NE(disk->claim().error().message.find("no disk is mounted there"), std::string::npos);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(LinuxDisk, TheLockFileIsALink_IsNotFollowed) {
  const test::TemporaryFolder folder;
  std::filesystem::create_symlink("/tmp/nobody-made-this", folder / LinuxDisk::kLockFile);
  const auto disk = LinuxDisk::guest(folder.path().string(), false);
  EXPECT_EQ(disk->claim().error().code, Errc::kBadValue);
  EXPECT_FALSE(std::filesystem::exists("/tmp/nobody-made-this"));
}

TEST(LinuxDisk, TheLockFile_CanBeOpenedByItsOwnerOnly) {
  const test::TemporaryFolder folder;
  const auto disk = LinuxDisk::guest(folder.path().string(), false);
  ASSERT_TRUE(disk->claim());
  const auto mode = std::filesystem::status(folder / LinuxDisk::kLockFile).permissions();
  EXPECT_EQ(mode & std::filesystem::perms::mask,
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write)
      << "who can open a file can lock it";
}

// A reader during a rename sees one of the two files, complete.
TEST(LinuxDisk, ReadWhileRenamed_IsAlwaysOneOfTheTwo) {
  const test::TemporaryFolder folder;
  auto writer = LinuxDisk::open(folder.path().string()).value();
  auto reader = LinuxDisk::open(folder.path().string()).value();
  const std::vector<std::uint8_t> a(5000, 'a');
  const std::vector<std::uint8_t> b(9000, 'b');
  test::write_bytes(folder / "current", a);
  std::thread renaming([&] {
    for (int i = 0; i < 200; ++i) {
      const FileHandle file = writer->create("new").value();
      EXPECT_TRUE(writer->write(file, i % 2 == 0 ? b : a));
      writer->close(file);
      EXPECT_TRUE(writer->rename("new", "current"));
    }
  });
  for (int i = 0; i < 500; ++i) {
    const auto seen = reader->read("current", 1 << 20);
    EXPECT_TRUE(seen && (*seen == a || *seen == b));
  }
  renaming.join();
}

TEST(LinuxDisk, SpecialFile_IsNotReadAndDoesNotBlock) {
  const test::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  auto disk = LinuxDisk::open(folder.path().string()).value();
  EXPECT_EQ(disk->read("pipe", 100).error().code, Errc::kIo);
}

TEST(LinuxDisk, RootThatCannotBeMade_IsNamed) {
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "file", kBytes);
  const auto disk = LinuxDisk::open((folder / "file/under").string());
  ASSERT_FALSE(disk);
  EXPECT_EQ(disk.error().code, Errc::kIo);
  EXPECT_NE(disk.error().message.find("file/under"), std::string::npos);
}

}  // namespace
}  // namespace nodal::hal::linux_os
