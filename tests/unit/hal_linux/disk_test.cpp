// Tests that need a real file system.
#include "hal/linux/disk.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

#include "tests/support/pictures.h"

namespace nodal::hal::linux_os {
namespace {

const std::vector<std::uint8_t> kBytes{'x', 'y'};

// /dev/full is a file to which every write fails with ENOSPC.
TEST(LinuxDisk, NoRoom_IsDiskFullAndNamesTheFile) {
  auto disk = LinuxDisk::open("/dev").value();
  const auto file = disk->open_append("full");
  if (!file) GTEST_SKIP() << "no /dev/full";
  const Status status = disk->write(*file, kBytes);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kDiskFull);
  EXPECT_NE(status.error().message.find("/dev/full"), std::string::npos);
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
    EXPECT_EQ(disk->create(name).error().code, Errc::kBadValue) << name;
    EXPECT_EQ(disk->size(name).error().code, Errc::kBadValue) << name;
  }
  EXPECT_EQ(disk->remove("absolute/secret").error().code, Errc::kBadValue);
  EXPECT_EQ(disk->make_folder("relative/new").error().code, Errc::kBadValue);
  EXPECT_EQ(disk->list("absolute").error().code, Errc::kBadValue);
  EXPECT_EQ(test::read_bytes(folder / "outside/secret"), kBytes);
}

TEST(LinuxDisk, SymbolicLinkWithinTheFolder_IsFollowed) {
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "a", kBytes);
  std::filesystem::create_symlink("a", folder / "b");
  auto disk = LinuxDisk::open(folder.path().string()).value();
  EXPECT_EQ(disk->read("b", 100).value(), kBytes);
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
