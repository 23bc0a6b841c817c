#include "host_tool/console/files.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

class Files : public ::testing::Test {
 protected:
  Files() {
    std::string name = fs::temp_directory_path() / "nodal-files-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~Files() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return folder_ / name; }
  int count() const { return static_cast<int>(std::distance(fs::directory_iterator(folder_), {})); }

  fs::path folder_;
};

TEST_F(Files, WrittenAndReadBack_IsTheSameAndLeavesNothingElse) {
  const std::string content("a\0b\xff", 4);
  ASSERT_TRUE(write_file(path("x"), content));
  ASSERT_TRUE(write_file(path("x"), content));
  EXPECT_EQ(read_file(path("x"), 100).value(), content);
  EXPECT_EQ(count(), 1);
  struct stat info {};
  ASSERT_EQ(stat(path("x").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777U, 0644U);
}

TEST_F(Files, ReaderWhoHasTheOldFileOpen_StillSeesItWhole) {
  ASSERT_TRUE(write_file(path("x"), std::string_view("old")));
  std::ifstream reader(path("x"));
  ASSERT_TRUE(write_file(path("x"), std::string_view("new")));
  std::string seen;
  reader >> seen;
  EXPECT_EQ(seen, "old");
  EXPECT_EQ(read_file(path("x"), 100).value(), "new");
}

TEST_F(Files, FullDevice_IsDiskFullAndNamesTheFile) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full here";
  const Status written = write_file("/dev/full", std::string_view("x"));
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, Errc::kDiskFull);
  EXPECT_NE(written.error().message.find("/dev/full"), std::string::npos);
}

TEST_F(Files, FolderThatIsNotThere_IsNotFound) {
  EXPECT_EQ(write_file(path("no/x"), std::string_view("x")).error().code, Errc::kNotFound);
  EXPECT_EQ(read_file(path("no"), 1).error().code, Errc::kNotFound);
  EXPECT_EQ(write_file(folder_.string(), std::string_view("x")).error().code, Errc::kIo);
}

TEST_F(Files, LongerThanTheLimit_IsTooLarge) {
  ASSERT_TRUE(write_file(path("x"), std::string_view("12345")));
  EXPECT_TRUE(read_file(path("x"), 5));
  EXPECT_EQ(read_file(path("x"), 4).error().code, Errc::kTooLarge);
}

TEST(NumberedName, OneConversion_IsReplaced) {
  EXPECT_EQ(*numbered_name("r-%06d.jpg", 7), "r-000007.jpg");
  EXPECT_EQ(*numbered_name("r-%d.jpg", 1234567), "r-1234567.jpg");
  EXPECT_EQ(*numbered_name("100%%-%2d.png", 3), "100%-03.png");
  EXPECT_EQ(*numbered_name("plain.jpg", 3), "plain.jpg");
  EXPECT_TRUE(has_number("r-%06d.jpg"));
  EXPECT_FALSE(has_number("100%%d.jpg"));
}

TEST(NumberedName, OtherConversions_AreRefused) {
  for (const char* pattern : {"%s", "%", "a%", "%d%d", "%n", "%-3d", "%0000006d", "%x.jpg"}) {
    const auto name = numbered_name(pattern, 1);
    ASSERT_FALSE(name) << pattern;
    EXPECT_EQ(name.error().code, Errc::kBadValue);
    EXPECT_FALSE(has_number(pattern));
  }
}

}  // namespace
}  // namespace nodal::host
