// What exists is never written over, links are never followed, one program at a time owns a folder, and its disk may be
// exchanged: the tests that every DiskPort must pass.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "disk_world.h"

namespace nodal::hal {
namespace {

class DiskGuestConformance : public DiskTestOfEvery {};

TEST_P(DiskGuestConformance, WhatExists_IsNeverCreatedAgain) {
  put("a", "first");
  ASSERT_TRUE(disk().make_folder("f"));
  put("f/b", "in it");
  world_->make_link("a", "link");
  world_->make_link("nowhere", "dangling");
  for (const std::string name : {"a", "f", "f/b", "link", "dangling"}) {
    expect_error(disk().create(name), Errc::kExists, name);
    expect_error(disk().make_folder(name), Errc::kExists, name);
    put("new", "second");
    expect_error(disk().rename_new("new", name), Errc::kExists, name);
    EXPECT_EQ(get("new"), "second");
    ASSERT_TRUE(disk().remove("new"));
  }
  EXPECT_EQ(get("a"), "first");
  EXPECT_EQ(get("f/b"), "in it");
  expect_error(disk().size("nowhere"), Errc::kNotFound, "nowhere");
}

TEST_P(DiskGuestConformance, RenamedToANameThatIsFree_IsThereAndTheOldNameIsGone) {
  put("new.tmp", "a document");
  ASSERT_TRUE(disk().rename_new("new.tmp", "document"));
  EXPECT_EQ(get("document"), "a document");
  EXPECT_EQ(disk().list("").value(), Names{"document"});
}

TEST_P(DiskGuestConformance, ASymbolicLink_IsNeverFollowedAndOnlyItselfRemoved) {
  ASSERT_TRUE(disk().make_folder("protected"));
  put("protected/film", "frames");
  world_->make_link("protected", "link");
  world_->make_link("protected/film", "film");
  for (const std::string name : {"link/film", "film"}) {
    expect_error(disk().open_append(name), Errc::kBadValue, name);
    expect_error(disk().open_read(name), Errc::kBadValue, name);
    expect_error(disk().read(name, 10), Errc::kBadValue, name);
    expect_error(disk().size(name), Errc::kBadValue, name);
  }
  expect_error(disk().create("link/new"), Errc::kBadValue, "link");
  expect_error(disk().make_folder("link/new"), Errc::kBadValue, "link");
  expect_error(disk().remove("link/film"), Errc::kBadValue, "link");
  expect_error(disk().rename("link/film", "mine"), Errc::kBadValue, "link");
  expect_error(disk().list("link"), Errc::kBadValue, "link");
  expect_error(disk().entries("link"), Errc::kBadValue, "link");
  ASSERT_TRUE(disk().remove("link"));
  ASSERT_TRUE(disk().remove("film"));
  EXPECT_EQ(disk().list("").value(), Names{"protected"});
  EXPECT_EQ(get("protected/film"), "frames");
}

TEST_P(DiskGuestConformance, AFileWithASecondName_IsReadAndRemovedAndNotWritten) {
  put("film", "frames");
  world_->make_second_name("film", "second");
  expect_error(disk().open_append("film"), Errc::kBadValue, "film");
  EXPECT_EQ(get("second"), "frames");
  ASSERT_TRUE(disk().remove("second"));
  const auto file = disk().open_append("film");
  ASSERT_TRUE(file) << file.error().text();
  disk().close(*file);
}

TEST_P(DiskGuestConformance, Entries_SayWhatTheyAreAndWhenTheyChange) {
  ASSERT_TRUE(disk().make_folder("folder"));
  put("file", "x");
  world_->make_link("file", "link");
  const std::vector<FolderEntry> before = disk().entries("").value();
  ASSERT_EQ(before.size(), 3U);
  EXPECT_EQ(before[0].name, "file");
  EXPECT_EQ(before[0].kind, EntryKind::kFile);
  EXPECT_EQ(before[1].name, "folder");
  EXPECT_EQ(before[1].kind, EntryKind::kFolder);
  EXPECT_EQ(before[2].name, "link");
  EXPECT_EQ(before[2].kind, EntryKind::kOther);
  EXPECT_EQ(disk().entries("").value(), before);
  put("folder/new", "y");
  const std::vector<FolderEntry> after = disk().entries("").value();
  ASSERT_EQ(after.size(), 3U);
  EXPECT_EQ(after[0], before[0]);
  EXPECT_NE(after[1], before[1]) << "it has an entry more";
  EXPECT_EQ(after[2], before[2]);
}

TEST_P(DiskGuestConformance, AFolderOfMoreThanCanBeListed_IsTooLargeAndNamedAndItsFilesAreReached) {
  ASSERT_TRUE(disk().make_folder("many"));
  put("many/film", "frames");
  const std::string name = "many/" + std::string(200, 'x');
  for (std::size_t k = 0; k * 200 <= FolderListing::kMaxNamesBytes; ++k)
    world_->make_link("film", name + std::to_string(k));
  expect_error(disk().list("many"), Errc::kTooLarge, "many");
  expect_error(disk().entries("many"), Errc::kTooLarge, "many");
  EXPECT_EQ(get("many/film"), "frames");
  EXPECT_EQ(disk().list("").value(), Names{"many"});
}

TEST_P(DiskGuestConformance, ClaimedByOne_IsRefusedToEveryOtherUntilItIsReleased) {
  const auto other = world_->other();
  ASSERT_TRUE(disk().claim());
  ASSERT_TRUE(disk().claim()) << "it has it";
  const Status refused = other->claim();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBusy);
  EXPECT_NE(refused.error().message.find("another nodald uses it"), std::string::npos) << refused.error().message;
  EXPECT_TRUE(other->list("")) << "reading needs no claim";
  disk().release();
  disk().release();
  ASSERT_TRUE(other->claim());
  EXPECT_EQ(disk().claim().error().code, Errc::kBusy);
  other->release();
  EXPECT_TRUE(disk().claim());
}

TEST_P(DiskGuestConformance, APortThatEnds_LeavesNoClaim) {
  auto other = world_->other();
  ASSERT_TRUE(other->claim());
  other.reset();
  EXPECT_TRUE(disk().claim());
}

TEST_P(DiskGuestConformance, ExchangedWhileNothingIsClaimed_EveryCallConcernsTheNewOne) {
  put("old", "1");
  const auto before = disk().identity();
  ASSERT_TRUE(before);
  EXPECT_EQ(disk().identity().value(), *before);
  world_->exchange();
  const auto after = disk().identity();
  ASSERT_TRUE(after);
  EXPECT_NE(*after, *before);
  EXPECT_TRUE(disk().list("").value().empty());
  put("new", "2");
  EXPECT_EQ(world_->other()->list("").value(), Names{"new"});
}

TEST_P(DiskGuestConformance, ExchangedDuringAClaim_TheClaimStaysWithTheOldOneAndTheIdentitySaysIt) {
  ASSERT_TRUE(disk().claim());
  const auto before = disk().identity();
  const FileHandle file = disk().create("film").value();
  world_->exchange();
  EXPECT_NE(disk().identity().value(), before.value());
  ASSERT_TRUE(disk().write(file, bytes_of("frames")));
  disk().close(file);
  EXPECT_EQ(get("film"), "frames");
  expect_error(world_->other()->size("film"), Errc::kNotFound, "film");
  disk().release();
  expect_error(disk().size("film"), Errc::kNotFound, "film");
}

INSTANTIATE_TEST_SUITE_P(All, DiskGuestConformance, every_disk(), [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
