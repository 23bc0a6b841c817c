// The tests of files and names that every DiskPort must pass.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "disk_world.h"

namespace nodal::hal {
namespace {

class DiskConformance : public DiskTestOfEvery {};

TEST_P(DiskConformance, Written_ReadsBackTheSame) {
  put("a.json", "hello");
  EXPECT_EQ(get("a.json"), "hello");
  EXPECT_EQ(disk().size("a.json").value(), 5U);
}

TEST_P(DiskConformance, WrittenInPieces_EachGoesBehindTheLast) {
  const FileHandle file = disk().create("log").value();
  ASSERT_TRUE(disk().write(file, bytes_of("one ")));
  ASSERT_TRUE(disk().write(file, {}));
  ASSERT_TRUE(disk().write(file, bytes_of("two ")));
  disk().close(file);
  const FileHandle again = disk().open_append("log").value();
  ASSERT_TRUE(disk().write(again, bytes_of("three")));
  disk().close(again);
  EXPECT_EQ(get("log"), "one two three");
}

TEST_P(DiskConformance, NotThere_EveryCallSaysNotFoundAndNamesIt) {
  expect_error(disk().open_append("gone"), Errc::kNotFound, "gone");
  expect_error(disk().open_read("gone"), Errc::kNotFound, "gone");
  expect_error(disk().read("gone", 10), Errc::kNotFound, "gone");
  expect_error(disk().size("gone"), Errc::kNotFound, "gone");
  expect_error(disk().rename("gone", "new"), Errc::kNotFound, "gone");
  expect_error(disk().remove("gone"), Errc::kNotFound, "gone");
  expect_error(disk().list("gone"), Errc::kNotFound, "gone");
  expect_error(disk().sync_folder("gone"), Errc::kNotFound, "gone");
  expect_error(disk().create("gone/a"), Errc::kNotFound, "gone");
}

TEST_P(DiskConformance, OverTheReadLimit_IsTooLargeAndAtItIsNot) {
  put("a", "12345");
  expect_error(disk().read("a", 4), Errc::kTooLarge, "a");
  EXPECT_EQ(disk().read("a", 5).value(), bytes_of("12345"));
  put("empty", "");
  EXPECT_EQ(disk().read("empty", 0).value().size(), 0U);
}

TEST_P(DiskConformance, Renamed_ReplacesTheOtherWholeAndTheOldNameIsGone) {
  put("current", "old calibration");
  put("new.tmp", "new calibration");
  ASSERT_TRUE(disk().rename("new.tmp", "current"));
  EXPECT_EQ(get("current"), "new calibration");
  expect_error(disk().size("new.tmp"), Errc::kNotFound, "new.tmp");
  EXPECT_EQ(disk().list("").value(), Names{"current"});
}

TEST_P(DiskConformance, RenamedWhileOpen_TheHandleGoesOnWithTheFile) {
  const FileHandle file = disk().create("a").value();
  ASSERT_TRUE(disk().write(file, bytes_of("1")));
  ASSERT_TRUE(disk().rename("a", "b"));
  ASSERT_TRUE(disk().write(file, bytes_of("2")));
  disk().close(file);
  EXPECT_EQ(get("b"), "12");
}

TEST_P(DiskConformance, RenamedOntoItself_Stays) {
  put("a", "x");
  ASSERT_TRUE(disk().rename("a", "a"));
  EXPECT_EQ(get("a"), "x");
}

TEST_P(DiskConformance, Removed_IsGone) {
  put("a", "x");
  ASSERT_TRUE(disk().remove("a"));
  expect_error(disk().size("a"), Errc::kNotFound, "a");
}

TEST_P(DiskConformance, Folders_HoldFilesAndListSorted) {
  ASSERT_TRUE(disk().make_folder("takes"));
  ASSERT_TRUE(disk().make_folder("takes/7"));
  put("takes/b", "2");
  put("takes/a", "1");
  put("takes/7/c", "3");
  put("takes-of-another-name", "4");
  EXPECT_EQ(disk().list("takes").value(), (Names{"7", "a", "b"}));
  EXPECT_EQ(disk().list("").value(), (Names{"takes", "takes-of-another-name"}));
  ASSERT_TRUE(disk().rename("takes/7/c", "takes/c"));
  EXPECT_EQ(get("takes/c"), "3");
  ASSERT_TRUE(disk().sync_folder("takes"));
  ASSERT_TRUE(disk().sync_folder(""));
}

TEST_P(DiskConformance, FolderWithFiles_IsNotRemovedAndAnEmptyOneIs) {
  ASSERT_TRUE(disk().make_folder("f"));
  put("f/a", "x");
  expect_error(disk().remove("f"), Errc::kExists, "f");
  EXPECT_EQ(get("f/a"), "x");
  ASSERT_TRUE(disk().remove("f/a"));
  ASSERT_TRUE(disk().remove("f"));
  EXPECT_TRUE(disk().list("").value().empty());
}

TEST_P(DiskConformance, FolderForAFile_IsRefusedByName) {
  ASSERT_TRUE(disk().make_folder("f"));
  expect_error(disk().create("f"), Errc::kExists, "f");
  expect_error(disk().read("f", 10), Errc::kIo, "f");
  expect_error(disk().open_read("f"), Errc::kIo, "f");
  put("a", "x");
  expect_error(disk().make_folder("a"), Errc::kExists, "a");
  expect_error(disk().rename("a", "f"), Errc::kUnsupported, "f");
}

TEST_P(DiskConformance, NamesThatLeadOutside_AreBadValuesEverywhere) {
  put("a", "x");
  for (const std::string name : {"../a", "/etc/passwd", "f/../../a", "", ".", "..", "f//a", "f/", "./a"}) {
    expect_error(disk().create(name), Errc::kBadValue, name);
    expect_error(disk().open_append(name), Errc::kBadValue, name);
    expect_error(disk().open_read(name), Errc::kBadValue, name);
    expect_error(disk().read(name, 10), Errc::kBadValue, name);
    expect_error(disk().size(name), Errc::kBadValue, name);
    expect_error(disk().rename(name, "b"), Errc::kBadValue, name);
    expect_error(disk().rename("a", name), Errc::kBadValue, name);
    expect_error(disk().remove(name), Errc::kBadValue, name);
    expect_error(disk().make_folder(name), Errc::kBadValue, name);
    if (!name.empty()) {
      expect_error(disk().list(name), Errc::kBadValue, name);
      expect_error(disk().sync_folder(name), Errc::kBadValue, name);
    }
  }
  const std::string hidden("a\0b", 3);
  EXPECT_EQ(disk().create(hidden).error().code, Errc::kBadValue);
}

TEST_P(DiskConformance, HandleNotOpen_IsWrongState) {
  const FileHandle file = disk().create("a").value();
  disk().close(file);
  disk().close(file);
  EXPECT_EQ(disk().write(file, bytes_of("x")).error().code, Errc::kWrongState);
  EXPECT_EQ(disk().sync(file).error().code, Errc::kWrongState);
}

TEST_P(DiskConformance, ReadAtAnyPlace_GivesTheBytesThereAndFewerOnlyAtTheEnd) {
  put("a", "0123456789");
  const FileHandle file = disk().open_read("a").value();
  std::vector<std::uint8_t> into(4);
  const auto at = [&](std::uint64_t offset) {
    const auto count = disk().read_at(file, offset, into);
    return count ? std::string(into.begin(), into.begin() + static_cast<std::ptrdiff_t>(*count)) : count.error().text();
  };
  EXPECT_EQ(at(6), "6789");
  EXPECT_EQ(at(0), "0123");
  EXPECT_EQ(at(8), "89");
  for (const std::uint64_t behind :
       {std::uint64_t{10}, std::uint64_t{11}, std::uint64_t{1} << 32, (std::uint64_t{1} << 63) - 1,
        std::uint64_t{1} << 63, ~std::uint64_t{0} - 3, ~std::uint64_t{0}}) {
    EXPECT_EQ(at(behind), "") << behind;
  }
  EXPECT_EQ(disk().read_at(file, 3, {}).value(), 0U);
  disk().close(file);
  EXPECT_EQ(disk().read_at(file, 0, into).error().code, Errc::kWrongState);
}

TEST_P(DiskConformance, TheFileChangesBetweenReads_EachGivesWhatIsThere) {
  put("a", "one");
  const FileHandle reader = disk().open_read("a").value();
  const FileHandle writer = disk().open_append("a").value();
  std::vector<std::uint8_t> into(8);
  EXPECT_EQ(disk().read_at(reader, 0, into).value(), 3U);
  ASSERT_TRUE(disk().write(writer, bytes_of("two")));
  EXPECT_EQ(disk().read_at(reader, 0, into).value(), 6U);
  ASSERT_TRUE(disk().rename("a", "b"));
  EXPECT_EQ(disk().read_at(reader, 3, into).value(), 3U) << "a handle goes on with its file";
  ASSERT_TRUE(disk().remove("b"));
  EXPECT_EQ(disk().read_at(reader, 3, into).value(), 3U) << "a file lives as long as a handle of it";
}

TEST_P(DiskConformance, AHandle_IsForReadingOrForWriting) {
  put("a", "x");
  std::vector<std::uint8_t> into(1);
  const FileHandle reader = disk().open_read("a").value();
  EXPECT_EQ(disk().write(reader, bytes_of("y")).error().code, Errc::kWrongState);
  for (const FileHandle writer : {disk().open_append("a").value(), disk().create("b").value()}) {
    EXPECT_EQ(disk().read_at(writer, 0, into).error().code, Errc::kWrongState);
  }
  EXPECT_EQ(get("a"), "x");
}

TEST_P(DiskConformance, GatheredPieces_AreOneAfterTheOther) {
  const FileHandle file = disk().create("log").value();
  std::vector<std::vector<std::uint8_t>> texts;
  std::string all = "start ";
  ASSERT_TRUE(disk().write(file, bytes_of(all)));
  for (int k = 0; k < 200; ++k) {  // more than one system call takes, empty ones among them
    texts.push_back(bytes_of(k % 3 == 0 ? "" : std::to_string(k) + " "));
    all.append(texts.back().begin(), texts.back().end());
  }
  const std::vector<std::span<const std::uint8_t>> pieces(texts.begin(), texts.end());
  ASSERT_TRUE(disk().write_pieces(file, pieces));
  ASSERT_TRUE(disk().write_pieces(file, {}));
  disk().start_write_out(file);
  disk().preallocate(file, 100'000);
  EXPECT_EQ(disk().size("log").value_or(0), all.size()) << "room is no length";
  ASSERT_TRUE(disk().write(file, bytes_of("end")));
  ASSERT_TRUE(disk().sync_all());
  EXPECT_EQ(get("log"), all + "end");
}

TEST_P(DiskConformance, OverwrittenBytes_LieInOneSectorAndAppendingGoesOnAtTheEnd) {
  const FileHandle file = disk().create("log").value();
  ASSERT_TRUE(disk().write(file, bytes_of(std::string(512, 'a') + std::string(100, 'b'))));
  ASSERT_TRUE(disk().overwrite(file, 510, bytes_of("xy")));
  ASSERT_TRUE(disk().overwrite(file, 512, bytes_of("z")));
  ASSERT_TRUE(disk().overwrite(file, 9, {}));
  expect_error(disk().overwrite(file, 511, bytes_of("xy")), Errc::kBadValue, "log");
  expect_error(disk().overwrite(file, 611, bytes_of("xy")), Errc::kBadValue, "log");
  expect_error(disk().overwrite(file, UINT64_MAX, bytes_of("x")), Errc::kBadValue, "log");
  ASSERT_TRUE(disk().write(file, bytes_of("end")));
  EXPECT_EQ(get("log"), std::string(510, 'a') + "xyz" + std::string(99, 'b') + "end");
}

TEST_P(DiskConformance, Shortened_LosesItsEndAndGrowsFromThere) {
  put("log", "hello world");
  const FileHandle file = disk().open_append("log").value();
  ASSERT_TRUE(disk().truncate(file, 5));
  expect_error(disk().truncate(file, 6), Errc::kBadValue, "log");
  EXPECT_EQ(get("log"), "hello");
  ASSERT_TRUE(disk().write(file, bytes_of("!")));
  EXPECT_EQ(get("log"), "hello!");
  ASSERT_TRUE(disk().truncate(file, 0));
  EXPECT_EQ(get("log"), "");
}

TEST_P(DiskConformance, TheWholeDisk_IsAtLeastAsLargeAsWhatIsFree) {
  EXPECT_GE(disk().total_bytes().value(), disk().free_bytes().value());
}

TEST_P(DiskConformance, AMegabyte_TakesThatMuchRoom) {
  const std::uint64_t before = disk().free_bytes().value();
  EXPECT_GT(before, 0U);
  const FileHandle file = disk().create("big").value();
  const std::vector<std::uint8_t> megabyte(1 << 20, 0xA5);
  ASSERT_TRUE(disk().write(file, megabyte));
  ASSERT_TRUE(disk().sync(file));
  disk().close(file);
  EXPECT_EQ(disk().read("big", 1 << 20).value(), megabyte);
}

INSTANTIATE_TEST_SUITE_P(All, DiskConformance, every_disk(), [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
