// Takes on a disk that others use, too: people who bring takes and take them away, cards that are exchanged, a second
// nodald.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "firmware/record/take_shelf.h"
#include "firmware/storage/durable_file.h"
#include "hal/sim/card_slot.h"
#include "tests/support/take_account.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimCardSlot;
using hal::sim::SimClock;
using hal::sim::SimDisk;
using Bytes = std::vector<std::uint8_t>;

/// A slot with an empty card, and a rig that records on it.
struct ShelfWorld {
  ShelfWorld() { slot.insert(std::make_shared<SimDisk>(1)); }
  SimDisk& card() { return *slot.disk(); }

  SimClock clock;
  SimCardSlot slot;
  std::unique_ptr<hal::DiskPort> port = slot.port();
  TakeStage stage{*port, clock, {}};
};

/// Records for a second. Returns the take's number; 0 if it was refused.
std::uint64_t record(TakeStage& stage) {
  const TakeAnswer started = stage.start();
  if (!started.result) return 0;
  stage.run(Duration::seconds(1));
  EXPECT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  return std::get<TakeAnswer::Done>(*started.result).take;
}

std::map<std::string, Bytes> files_of(SimDisk& disk, const std::string& folder) {
  std::map<std::string, Bytes> files;
  for (const std::string& name : disk.list(folder).value_or(std::vector<std::string>())) {
    if (auto bytes = disk.read(folder + "/" + name, 1 << 26)) files[name] = std::move(*bytes);
  }
  return files;
}

void put(SimDisk& disk, const std::string& name, const Bytes& bytes) {
  const auto file = disk.create(name);
  ASSERT_TRUE(file) << file.error().text();
  ASSERT_TRUE(disk.write(*file, bytes));
  disk.close(*file);
}

/// As `cp -a` does.
void copy_folder(SimDisk& from, const std::string& folder, SimDisk& to, const std::string& name) {
  const auto files = files_of(from, folder);
  ASSERT_TRUE(to.make_folder(name));
  for (const auto& [file, bytes] : files) put(to, name + "/" + file, bytes);
}

void remove_folder(SimDisk& disk, const std::string& folder) {
  for (const auto& [name, bytes] : files_of(disk, folder)) ASSERT_TRUE(disk.remove(folder + "/" + name));
  ASSERT_TRUE(disk.remove(folder));
}

std::vector<std::uint64_t> numbers(const std::vector<TakeEntry>& takes) {
  std::vector<std::uint64_t> found;
  for (const TakeEntry& take : takes) found.push_back(take.number);
  return found;
}

using Numbers = std::vector<std::uint64_t>;

TEST(TakeShelf, ATakeIsBroughtWhileNodaldRuns_ItIsListedAndTheNextGetsAnotherNumber) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  copy_folder(world.card(), "000001", world.card(), "000002");
  const auto brought = files_of(world.card(), "000002");
  EXPECT_EQ(record(world.stage), 3U);
  EXPECT_EQ(files_of(world.card(), "000002"), brought);
  const std::vector<TakeEntry> takes = world.stage.list();
  EXPECT_EQ(numbers(takes), (Numbers{1, 2, 3}));
  EXPECT_EQ(takes.at(1).state, TakeState::kComplete);
  EXPECT_EQ(takes.at(1).sets, takes.at(0).sets);
}

TEST(TakeShelf, AnythingThatHasTheName_IsNeverWrittenOver) {
  ShelfWorld world;
  put(world.card(), "000001", {'x'});
  world.card().put_link("000002");
  EXPECT_EQ(record(world.stage), 3U);
  EXPECT_EQ(world.card().read("000001", 10).value(), Bytes{'x'});
  const std::vector<TakeEntry> takes = world.stage.list();
  ASSERT_EQ(numbers(takes), (Numbers{1, 2, 3}));
  for (const std::size_t k : {0U, 1U}) {
    EXPECT_EQ(takes[k].state, TakeState::kDamaged);
    EXPECT_NE(takes[k].problem.find("is not a folder"), std::string::npos) << takes[k].problem;
  }
}

TEST(TakeShelf, TakesBeyondTheListsLimit_CountForNumbers) {
  ShelfWorld world;
  for (std::uint64_t number = 1; number <= TakeShelf::kMaxTakes + 1; ++number) {
    ASSERT_TRUE(world.card().make_folder(take::take_folder(number)));
    put(world.card(), take::take_folder(number) + "/film.mov", {'x'});
  }
  const TakeAnswer full = world.stage.start();
  ASSERT_FALSE(full.result);
  EXPECT_NE(full.result.error().message.find("the most that there may be"), std::string::npos);
  remove_folder(world.card(), "000001");
  remove_folder(world.card(), "000002");
  EXPECT_EQ(record(world.stage), TakeShelf::kMaxTakes + 2);
  EXPECT_EQ(files_of(world.card(), "001001").size(), 1U);
}

TEST(TakeShelf, TheHighestNumberIsUsedUp_NoTakeBeginsAndItSaysWhatToDo) {
  ShelfWorld world;
  ASSERT_TRUE(write_durably(world.card(), "", kNextTakeFile, "18446744073709551615"));
  const TakeAnswer refused = world.stage.start();
  ASSERT_FALSE(refused.result);
  EXPECT_NE(refused.result.error().message.find(kNextTakeFile), std::string::npos) << refused.result.error().message;
}

TEST(TakeShelf, ATakeIsRemovedByHand_ItIsNoLongerListedAndItsNumberNotUsedAgain) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  ASSERT_EQ(record(world.stage), 2U);
  remove_folder(world.card(), "000002");
  EXPECT_EQ(numbers(world.stage.list()), Numbers{1});
  const TakeAnswer deleted = world.stage.ask(TakeRequest::Delete{2});
  ASSERT_FALSE(deleted.result);
  EXPECT_EQ(deleted.result.error().code, Errc::kNotFound);
  EXPECT_EQ(record(world.stage), 3U);
}

/// Somebody may still be copying it.
TEST(TakeShelf, AnUnfinishedTakeComesWhileNodaldRuns_IsLeftAloneUntilTheNextStart) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  copy_folder(world.card(), "000001", world.card(), "000002");
  ASSERT_TRUE(world.card().remove("000002/manifest"));
  const auto brought = files_of(world.card(), "000002");
  world.stage.run(Duration::seconds(10));
  ASSERT_EQ(world.stage.list().size(), 2U);
  EXPECT_EQ(world.stage.list()[1].state, TakeState::kUnfinished);
  EXPECT_NE(world.stage.list()[1].problem.find("came to the disk while nodald runs"), std::string::npos);
  EXPECT_EQ(files_of(world.card(), "000002"), brought);
  TakeStage next(*world.port, world.clock, {});
  next.run(Duration::seconds(1));
  EXPECT_EQ(next.list().at(1).state, TakeState::kComplete) << next.list().at(1).problem;
}

TEST(TakeShelf, TwoUseOneFolder_OnlyOneRecordsAndNothingOfTheOtherIsTouched) {
  ShelfWorld world;
  ASSERT_TRUE(world.stage.start().result);
  world.stage.run(Duration::seconds(3));
  const auto other_port = world.slot.port();
  TakeStage other(*other_port, world.clock, {});
  other.run(Duration::seconds(3));
  ASSERT_EQ(other.list().size(), 1U);
  EXPECT_EQ(other.list()[0].state, TakeState::kUnfinished) << "it is being recorded";
  EXPECT_NE(other.report().no_disk.find("another nodald uses the takes folder"), std::string::npos);
  const auto expect_refused = [&](TakeCommand what) {
    const TakeAnswer refused = other.ask(std::move(what));
    ASSERT_FALSE(refused.result);
    EXPECT_EQ(refused.result.error().code, Errc::kBusy);
    EXPECT_NE(refused.result.error().message.find("another nodald uses the takes folder"), std::string::npos);
  };
  expect_refused(TakeRequest::Start{});
  expect_refused(TakeRequest::Delete{1});
  expect_refused(TakeRequest::Protect{1, true});
  ASSERT_TRUE(world.stage.ask(TakeRequest::Stop{}).result);
  const TakeAccount account = account_of(world.card(), 1);
  EXPECT_EQ(account.missed + account.cut, 0U);
  other.run(Duration::seconds(3));
  EXPECT_EQ(other.list().at(0).ended, "stopped") << "nobody recovered it";
  EXPECT_EQ(other.report().no_disk, "");
  EXPECT_EQ(record(other), 2U);
  EXPECT_EQ(record(world.stage), 3U);
  EXPECT_EQ(record(other), 4U);
}

TEST(TakeShelf, TheOneThatRecordsIsKilled_AnotherThatWaitsFinishesItsTake) {
  ShelfWorld world;
  std::unique_ptr<hal::DiskPort> killed_port = world.slot.port();
  auto killed = std::make_unique<TakeStage>(*killed_port, world.clock, TakeStage::Options{});
  ASSERT_TRUE(killed->start().result);
  killed->run(Duration::seconds(5));
  const auto other_port = world.slot.port();
  TakeStage other(*other_port, world.clock, {});
  other.run(Duration::seconds(3));
  ASSERT_EQ(other.list().at(0).state, TakeState::kUnfinished);
  killed.reset();
  killed_port.reset();
  other.run(Duration::seconds(3));
  EXPECT_EQ(other.list().at(0).state, TakeState::kComplete);
  EXPECT_EQ(other.list().at(0).ended, "recovered");
  EXPECT_GE(other.list().at(0).sets, 20U);
}

TEST(TakeShelf, NothingIsRecorded_NothingOfTheDiskIsHeld) {
  ShelfWorld world;
  EXPECT_FALSE(world.card().claimed());
  ASSERT_TRUE(world.stage.start().result);
  EXPECT_TRUE(world.card().claimed());
  world.stage.run(Duration::seconds(1));
  ASSERT_TRUE(world.stage.ask(TakeRequest::Stop{}).result);
  EXPECT_FALSE(world.card().claimed());
  for (const TakeCommand& what : {TakeCommand(TakeRequest::List{}), TakeCommand(TakeRequest::Protect{1, true}),
                                  TakeCommand(TakeRequest::Delete{1}), TakeCommand(TakeRequest::Protect{1, false}),
                                  TakeCommand(TakeRequest::Delete{1})}) {
    (void)world.stage.ask(what);
    EXPECT_FALSE(world.card().claimed());
  }
  EXPECT_TRUE(world.stage.list().empty());
}

TEST(TakeShelf, TheCardIsExchanged_TheNewOneIsNoticedWithinTwoSecondsAndTheNextTakeIsOnIt) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  ASSERT_EQ(record(world.stage), 2U);
  const auto first = world.slot.disk();
  const auto before = files_of(*first, "000001");
  const auto second = std::make_shared<SimDisk>(2);
  copy_folder(*first, "000001", *second, "000007");
  const std::uint64_t disks = world.stage.report().disks;
  world.slot.insert(second);
  world.stage.run(Duration::seconds(2));
  EXPECT_EQ(world.stage.report().disks, disks + 1);
  EXPECT_EQ(numbers(world.stage.list()), Numbers{7});
  EXPECT_EQ(record(world.stage), 8U);
  EXPECT_EQ(files_of(*first, "000001"), before);
  EXPECT_EQ(first->list("").value(), (std::vector<std::string>{"000001", "000002", kNextTakeFile}));
  EXPECT_TRUE(second->size("000008/manifest"));
}

TEST(TakeShelf, TheCardComesWithAnUnfinishedTake_ItIsFinished) {
  ShelfWorld world;
  auto other = std::make_shared<SimDisk>(5);
  {
    SimClock clock;
    TakeStage stage(*other, clock, {});
    ASSERT_TRUE(stage.start().result);
    stage.run(Duration::seconds(5));
  }
  other = other->after_kill();
  world.slot.insert(other);
  world.stage.run(Duration::seconds(3));
  EXPECT_EQ(world.stage.list().at(0).ended, "recovered");
  EXPECT_TRUE(world.stage.report().ready);
}

TEST(TakeShelf, TheCardIsExchangedWhileATakeIsRecorded_ItIsFinishedOnItsOwnAndTheOtherIsNotTouched) {
  ShelfWorld world;
  ASSERT_TRUE(world.stage.start().result);
  world.stage.run(Duration::seconds(3));
  const auto first = world.slot.disk();
  world.slot.insert(std::make_shared<SimDisk>(2));
  world.stage.run(Duration::seconds(2));
  EXPECT_FALSE(world.stage.report().recording);
  EXPECT_TRUE(world.stage.report().interrupted);
  EXPECT_NE(world.stage.report().problem.find("take 1 ended: the disk was exchanged while the take was recorded"),
            std::string::npos)
      << world.stage.report().problem;
  EXPECT_TRUE(world.card().list("").value().empty());
  EXPECT_FALSE(first->claimed());
  const TakeAccount account = account_of(*first, 1);
  EXPECT_GE(account.sets, 10U);
  EXPECT_TRUE(first->size("000001/manifest"));
  EXPECT_EQ(record(world.stage), 2U) << "on the new one";
}

TEST(TakeShelf, TheCardIsPulledAndComesBack_ItsTakeIsFinished) {
  ShelfWorld world;
  ASSERT_TRUE(world.stage.start().result);
  world.stage.run(Duration::seconds(5));
  const auto card = world.slot.disk();
  world.slot.pull();
  world.stage.run(Duration::seconds(3));
  EXPECT_FALSE(world.stage.report().recording);
  EXPECT_FALSE(world.stage.report().ready);
  EXPECT_NE(world.stage.report().no_disk.find("no disk is mounted there"), std::string::npos);
  EXPECT_FALSE(world.stage.ask(TakeRequest::List{}).result);
  EXPECT_EQ(world.stage.start().result.error().code, Errc::kNotReady);
  card->unplug(false);
  world.slot.insert(card);
  world.stage.run(Duration::seconds(3));
  EXPECT_TRUE(world.stage.report().ready);
  EXPECT_EQ(world.stage.list().at(0).state, TakeState::kComplete);
  EXPECT_EQ(record(world.stage), 2U);
}

TEST(TakeShelf, TheFolderOfARunningTakeIsRemoved_TheTakeEndsAndSaysWhy) {
  ShelfWorld world;
  ASSERT_TRUE(world.stage.start().result);
  world.stage.run(Duration::seconds(2));
  remove_folder(world.card(), "000001");
  world.stage.run(Duration::seconds(2));
  EXPECT_FALSE(world.stage.report().recording);
  EXPECT_EQ(world.stage.report().problem, "take 1 ended: its folder was removed while it was recorded");
  EXPECT_TRUE(world.stage.list().empty());
}

TEST(TakeShelf, Ejected_TheTakeIsFinishedAndTheDiskIsLeftAloneUntilAnotherComes) {
  ShelfWorld world;
  ASSERT_TRUE(world.stage.start().result);
  world.stage.run(Duration::seconds(3));
  const TakeAnswer ejected = world.stage.ask(TakeRequest::Eject{});
  ASSERT_TRUE(ejected.result) << ejected.result.error().text();
  EXPECT_EQ(std::get<TakeAnswer::Done>(*ejected.result).take, 1U);
  EXPECT_FALSE(world.card().claimed());
  EXPECT_TRUE(world.card().after_power_loss(3)->size("000001/manifest")) << "all of it is durable";
  const std::uint64_t operations = world.card().operations();
  world.stage.run(Duration::seconds(5));
  for (const TakeCommand& what : {TakeCommand(TakeRequest::List{}), TakeCommand(TakeRequest::Delete{1}),
                                  TakeCommand(TakeRequest::Protect{1, true})}) {
    const TakeAnswer refused = world.stage.ask(what);
    ASSERT_FALSE(refused.result);
    EXPECT_EQ(refused.result.error().code, Errc::kNotReady);
    EXPECT_NE(refused.result.error().message.find("was ejected"), std::string::npos);
  }
  EXPECT_EQ(world.card().operations(), operations);
  EXPECT_FALSE(world.stage.report().ready);
  EXPECT_TRUE(world.stage.report().interrupted) << "a rig that records by itself goes on with the next disk";
  EXPECT_TRUE(world.stage.ask(TakeRequest::Eject{}).result) << "it is";
  world.slot.insert(std::make_shared<SimDisk>(2));
  world.stage.run(Duration::seconds(2));
  EXPECT_TRUE(world.stage.report().ready);
  EXPECT_TRUE(world.stage.list().empty());
}

TEST(TakeShelf, EjectedAndATakeIsAskedFor_TheDiskIsUsedAgain) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  const TakeAnswer ejected = world.stage.ask(TakeRequest::Eject{});
  ASSERT_TRUE(ejected.result);
  EXPECT_EQ(std::get<TakeAnswer::Done>(*ejected.result).take, 0U) << "none was recorded";
  EXPECT_EQ(record(world.stage), 2U);
  EXPECT_EQ(numbers(world.stage.list()), (Numbers{1, 2}));
}

TEST(TakeShelf, Protected_TheTakeIsListedAsSuchAndNotDeletedUntilItIsNot) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  ASSERT_TRUE(world.stage.ask(TakeRequest::Protect{1, true}).result);
  const TakeAnswer refused = world.stage.ask(TakeRequest::Delete{1});
  ASSERT_FALSE(refused.result);
  EXPECT_EQ(refused.result.error().code, Errc::kWrongState);
  EXPECT_TRUE(world.stage.list().at(0).is_protected);
  ASSERT_TRUE(world.stage.ask(TakeRequest::Protect{1, false}).result);
  EXPECT_FALSE(world.stage.list().at(0).is_protected);
  EXPECT_TRUE(world.stage.ask(TakeRequest::Protect{1, false}).result) << "it is";
  EXPECT_TRUE(world.stage.ask(TakeRequest::Delete{1}).result);
}

TEST(TakeShelf, ALinkHasATakesName_DeletingItIsRefusedAndTheProtectedTakeStaysWhole) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  ASSERT_TRUE(world.stage.ask(TakeRequest::Protect{1, true}).result);
  world.card().put_link("000002");  // to 000001
  const auto before = files_of(world.card(), "000001");
  EXPECT_FALSE(world.stage.ask(TakeRequest::Delete{2}).result);
  EXPECT_EQ(files_of(world.card(), "000001"), before);
}

TEST(TakeShelf, ATakeHoldsLinksAndAFolder_TheFolderStaysWithAllOfTheTakeAndLinksGoAsSuch) {
  ShelfWorld world;
  ASSERT_EQ(record(world.stage), 1U);
  world.card().put_link("000001/cam9-0000.mkv");
  ASSERT_TRUE(world.card().make_folder("000001/notes"));
  const auto before = files_of(world.card(), "000001");
  const TakeAnswer refused = world.stage.ask(TakeRequest::Delete{1});
  ASSERT_FALSE(refused.result);
  EXPECT_NE(refused.result.error().message.find("000001/notes"), std::string::npos) << refused.result.error().message;
  EXPECT_EQ(files_of(world.card(), "000001"), before);
  ASSERT_TRUE(world.card().remove("000001/notes"));
  EXPECT_TRUE(world.stage.ask(TakeRequest::Delete{1}).result);
  EXPECT_FALSE(world.card().list("000001"));
}

}  // namespace
}  // namespace nodal::firmware
