#include "firmware/calibration/calibration_store.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "hal/sim/disk.h"
#include "tests/support/rigs.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimDisk;

Calibration numbered(int n) {
  Calibration calibration = test::ring(3, 64, 48);
  calibration.name = "number " + std::to_string(n);
  return calibration;
}

void put_in_force(CalibrationStore& store, int n) {
  const auto entry = store.put(numbered(n));
  ASSERT_TRUE(entry) << entry.error().text();
  const Status done = store.set_in_force(entry->id);
  ASSERT_TRUE(done) << done.error().text();
}

CalibrationStore opened(SimDisk& disk) {
  auto store = CalibrationStore::open(disk);
  EXPECT_TRUE(store) << store.error().text();
  return std::move(*store);
}

/// Flips one bit of the stored document.
void damage(SimDisk& disk, const CalibrationStore::Entry& entry) {
  auto bytes = disk.read(entry.file, kMaxCalibrationBytes);
  ASSERT_TRUE(bytes);
  bytes->at(bytes->size() / 2) ^= 1;
  disk.put(entry.file, *bytes);
}

TEST(CalibrationStore, AnEmptyDisk_HasNothingInForce) {
  SimDisk disk;
  const CalibrationStore store = opened(disk);
  EXPECT_TRUE(store.entries().empty());
  EXPECT_FALSE(store.in_force());
  EXPECT_EQ(store.note(), "");
}

TEST(CalibrationStore, OpenedAgain_TheSameIsInForceAndReadsBackEqual) {
  SimDisk disk;
  {
    CalibrationStore store = opened(disk);
    put_in_force(store, 1);
    put_in_force(store, 2);
  }
  const CalibrationStore again = opened(disk);
  EXPECT_EQ(again.in_force(), calibration_id(numbered(2)));
  EXPECT_EQ(again.before(), calibration_id(numbered(1)));
  const auto loaded = again.load(*again.in_force());
  ASSERT_TRUE(loaded);
  EXPECT_EQ(*loaded, numbered(2));
  EXPECT_EQ(again.entries().at(0).name, "number 2");
  EXPECT_EQ(again.entries().at(0).heads, 3u);
  EXPECT_EQ(again.note(), "");
}

TEST(CalibrationStore, TheSameTwice_IsStoredOnce) {
  SimDisk disk;
  CalibrationStore store = opened(disk);
  put_in_force(store, 1);
  put_in_force(store, 2);
  put_in_force(store, 1);
  EXPECT_EQ(store.entries().size(), 2u);
  EXPECT_EQ(store.in_force(), calibration_id(numbered(1)));
}

TEST(CalibrationStore, DamagedOnes_CountAndGoBeforeTheGoodOnes) {
  constexpr int kDamaged = 3;
  SimDisk disk;
  {
    CalibrationStore store = opened(disk);
    for (int n = 1; n <= static_cast<int>(CalibrationStore::kKept); ++n) put_in_force(store, n);
    for (int i = 2; i < 2 + kDamaged; ++i) damage(disk, store.entries()[static_cast<std::size_t>(i)]);
  }
  const auto documents = [&] {
    const std::vector<std::string> names = disk.list("calibrations").value();
    return static_cast<std::size_t>(
        std::ranges::count_if(names, [](const std::string& name) { return name.ends_with(".json"); }));
  };
  CalibrationStore store = opened(disk);
  EXPECT_EQ(store.entries().size(), CalibrationStore::kKept - kDamaged);
  for (int n = 1; n <= kDamaged; ++n) {
    put_in_force(store, 100 + n);
    EXPECT_EQ(documents(), CalibrationStore::kKept) << n;
    EXPECT_EQ(store.entries().size(), CalibrationStore::kKept - kDamaged + static_cast<std::size_t>(n)) << n;
  }
  put_in_force(store, 200);
  EXPECT_EQ(store.entries().size(), CalibrationStore::kKept) << "now a good one had to go";
}

TEST(CalibrationStore, MoreFilesThanAreRead_TheNewestAreReadAndTheOneInForceHoweverOldItIs) {
  SimDisk disk;
  {
    CalibrationStore store = opened(disk);
    put_in_force(store, 1);
  }
  // Somebody copies files there. Those of the generations 2 to 11 are damaged.
  constexpr int kOld = 10;
  const int newest = 1 + kOld + static_cast<int>(CalibrationStore::kMaxRead) - 1;
  for (int n = 2; n <= newest + 1; ++n) {
    const std::string text = n <= 1 + kOld ? "damaged" : canonical_json(numbered(n));
    char generation[16];
    std::snprintf(generation, sizeof generation, "%08d", n);
    disk.put("calibrations/" + std::string(generation) + "-" + to_hex(calibration_id(numbered(n))) + ".json",
             std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  }
  CalibrationStore store = opened(disk);
  EXPECT_EQ(store.in_force(), calibration_id(numbered(1)));
  EXPECT_EQ(store.entries().size(), CalibrationStore::kMaxRead + 1);
  EXPECT_EQ(store.note(), "") << "the damaged ones are not read";
  put_in_force(store, 1000);
  EXPECT_EQ(disk.list("calibrations").value().size(), CalibrationStore::kKept + 1) << "and the pointer";
}

TEST(CalibrationStore, MoreThanItKeeps_TheOldestGoButNeverTheOneInForceOrBefore) {
  SimDisk disk;
  CalibrationStore store = opened(disk);
  put_in_force(store, 1);
  constexpr int kMany = 30;
  for (int i = 2; i <= kMany; ++i) {
    put_in_force(store, i);
    put_in_force(store, 1);  // the oldest of all is put in force repeatedly
  }
  EXPECT_EQ(store.entries().size(), CalibrationStore::kKept);
  EXPECT_EQ(store.in_force(), calibration_id(numbered(1)));
  EXPECT_TRUE(store.load(calibration_id(numbered(1))));
  EXPECT_TRUE(store.load(calibration_id(numbered(kMany))));
  EXPECT_FALSE(store.load(calibration_id(numbered(2))));
  const auto files = disk.list("calibrations");
  ASSERT_TRUE(files);
  EXPECT_EQ(files->size(), CalibrationStore::kKept + 1) << "and which is in force";
}

TEST(CalibrationStore, TheOneInForceIsDamaged_TheNewestGoodOneTakesItsPlaceAndItSaysSo) {
  SimDisk disk;
  CalibrationStore::Entry newest;
  {
    CalibrationStore store = opened(disk);
    for (int i = 1; i <= 3; ++i) put_in_force(store, i);
    newest = store.entries().front();
  }
  damage(disk, newest);
  const CalibrationStore again = opened(disk);
  EXPECT_EQ(again.in_force(), calibration_id(numbered(2)));
  EXPECT_EQ(again.entries().size(), 2u);
  EXPECT_NE(again.note().find(to_hex(newest.id).substr(0, 12)), std::string::npos) << again.note();
  EXPECT_NE(again.note().find("is in force instead"), std::string::npos) << again.note();
}

TEST(CalibrationStore, ADamagedCopyOfANewerGeneration_DoesNotHideTheGoodOne) {
  SimDisk disk;
  std::string good;
  {
    CalibrationStore store = opened(disk);
    put_in_force(store, 1);
    good = store.entries().front().file;
  }
  const auto bytes = disk.read(good, kMaxCalibrationBytes);
  ASSERT_TRUE(bytes);
  std::string copy = good;
  copy.replace(copy.find("00000001"), 8, "00000009");
  const auto file = disk.create(copy);
  ASSERT_TRUE(file && disk.write(*file, std::span(*bytes).first(bytes->size() / 2)));
  disk.close(*file);
  const CalibrationStore again = opened(disk);
  ASSERT_EQ(again.entries().size(), 1u);
  EXPECT_EQ(again.entries().front().file, good);
  EXPECT_TRUE(again.load(calibration_id(numbered(1))));
  EXPECT_NE(again.note(), "");
}

TEST(CalibrationStore, EverythingIsDamaged_NothingIsInForceAndItSaysSo) {
  SimDisk disk;
  std::vector<CalibrationStore::Entry> entries;
  {
    CalibrationStore store = opened(disk);
    for (int i = 1; i <= 3; ++i) put_in_force(store, i);
    entries = store.entries();
  }
  for (const auto& entry : entries) damage(disk, entry);
  CalibrationStore again = opened(disk);
  EXPECT_FALSE(again.in_force());
  EXPECT_NE(again.note().find("upload it again"), std::string::npos) << again.note();
  put_in_force(again, 4);
  EXPECT_EQ(opened(disk).in_force(), calibration_id(numbered(4)));
}

TEST(CalibrationStore, FilesThatAreNotItsOwn_AreLeftAlone) {
  SimDisk disk;
  { (void)opened(disk); }
  for (const char* name : {"calibrations/notes.txt", "calibrations/00000001-beef.json", "calibrations/x.tmp"}) {
    const auto file = disk.create(name);
    ASSERT_TRUE(file);
    disk.close(*file);
  }
  const CalibrationStore store = opened(disk);
  EXPECT_TRUE(store.entries().empty());
  EXPECT_EQ(*disk.list("calibrations"), (std::vector<std::string>{"00000001-beef.json", "notes.txt"}))
      << "only what was being written is swept up";
}

TEST(CalibrationStore, APrefix_FindsOneOrSaysWhy) {
  SimDisk disk;
  CalibrationStore store = opened(disk);
  put_in_force(store, 1);
  put_in_force(store, 2);
  const Sha256 id = calibration_id(numbered(1));
  const std::string whole(id.begin(), id.end());
  EXPECT_EQ(store.find(whole)->id, id);
  EXPECT_EQ(store.find(whole.substr(0, 5))->id, id);
  EXPECT_EQ(store.find("").error().code, Errc::kBadValue);
  EXPECT_EQ(store.find(whole + "x").error().code, Errc::kNotFound);
}

TEST(CalibrationStore, WhatIsNotStored_CannotComeIntoForce) {
  SimDisk disk;
  CalibrationStore store = opened(disk);
  put_in_force(store, 1);
  EXPECT_EQ(store.set_in_force(calibration_id(numbered(9))).error().code, Errc::kNotFound);
  EXPECT_EQ(store.in_force(), calibration_id(numbered(1)));
}

}  // namespace
}  // namespace nodal::firmware
