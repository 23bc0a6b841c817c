// The store of calibrations on a disk that fails at every call in turn, and with files that are not as it wrote them.
#include <gtest/gtest.h>

#include "firmware/calibration/calibration_store.h"
#include "hal/sim/disk.h"
#include "tests/support/rigs.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimDisk;

Calibration called(const std::string& name) {
  Calibration calibration = test::ring(2, 64, 48);
  calibration.name = name;
  return calibration;
}

CalibrationStore store_on(SimDisk& disk) {
  auto store = CalibrationStore::open(disk);
  EXPECT_TRUE(store) << store.error().text();
  return std::move(*store);
}

void write(SimDisk& disk, const std::string& name, std::span<const std::uint8_t> bytes) { disk.put(name, bytes); }

std::string signed_name(const CalibrationStore::Entry& entry) {
  return entry.file.substr(0, entry.file.size() - 5) + ".signed";
}

const SignedDocument& a_signed_document() {
  static const SignedDocument document{"-----BEGIN SSH SIGNATURE-----\nAAAA\n-----END SSH SIGNATURE-----",
                                       R"({"as": "signed"})"};
  return document;
}

TEST(CalibrationStoreLimits, TheDiskFailsAtAnyCallOfAPut_ItIsAnErrorAndNothingIsListed) {
  for (const bool with_signature : {false, true}) {
    const auto original = with_signature ? std::optional(a_signed_document()) : std::nullopt;
    for (std::uint64_t k = 0; k < 20; ++k) {
      SimDisk disk;
      CalibrationStore store = store_on(disk);
      ASSERT_TRUE(store.put(called("first")));
      const std::uint64_t before = disk.operations();
      disk.fail_at(before + k);
      const auto added = store.put(called("second"), original);
      if (disk.operations() <= before + k) {
        EXPECT_TRUE(added) << "the disk was not asked so often";
        EXPECT_GE(k, with_signature ? 10u : 5u);
        break;
      }
      ASSERT_FALSE(added) << "call " << k;
      EXPECT_EQ(store.entries().size(), 1u) << "call " << k;
      EXPECT_EQ(store.entries().front().name, "first");
      const auto again = store.put(called("second"), original);
      EXPECT_TRUE(again) << "the disk works again";
    }
  }
}

TEST(CalibrationStoreLimits, OpenedAgain_GenerationsGoOnAndTheNewestIsFirst) {
  SimDisk disk;
  {
    CalibrationStore store = store_on(disk);
    for (const char* name : {"one", "two", "three"}) ASSERT_TRUE(store.put(called(name)));
  }
  CalibrationStore store = store_on(disk);
  const auto fourth = store.put(called("four"));
  ASSERT_TRUE(fourth);
  EXPECT_EQ(fourth->generation, 4u);
  store = store_on(disk);
  std::vector<std::string> names;
  for (const auto& entry : store.entries()) names.push_back(entry.name);
  EXPECT_EQ(names, (std::vector<std::string>{"four", "three", "two", "one"}));
}

TEST(CalibrationStoreLimits, ASignedDocument_ComesBackAsItWasSigned) {
  SimDisk disk;
  CalibrationStore store = store_on(disk);
  const auto entry = store.put(called("one"), a_signed_document());
  ASSERT_TRUE(entry);
  const auto original = store.original(entry->id);
  ASSERT_TRUE(original && *original);
  EXPECT_EQ((*original)->json, a_signed_document().json);
  EXPECT_EQ((*original)->signature, a_signed_document().signature);
  const auto without = store.put(called("two"));
  ASSERT_TRUE(without);
  const auto none = store.original(without->id);
  ASSERT_TRUE(none);
  EXPECT_FALSE(*none);
}

TEST(CalibrationStoreLimits, ASignedDocumentThatIsDamagedOrUnreadable_IsAnError) {
  SimDisk disk;
  CalibrationStore store = store_on(disk);
  const auto entry = store.put(called("one"), a_signed_document());
  ASSERT_TRUE(entry);
  disk.fail_reads(1);
  const auto unreadable = store.original(entry->id);
  ASSERT_FALSE(unreadable);
  EXPECT_EQ(unreadable.error().code, Errc::kIo);
  for (const std::string_view text : {"", "no signature", "-----END SSH SIGNATURE-----"}) {
    write(disk, signed_name(*entry), std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
    const auto damaged = store.original(entry->id);
    ASSERT_FALSE(damaged) << text;
    EXPECT_EQ(damaged.error().code, Errc::kChecksum) << text;
  }
}

TEST(CalibrationStoreLimits, NamesThatAreNoneOfItsFiles_AreLeftAlone) {
  SimDisk disk;
  std::string good;
  {
    CalibrationStore store = store_on(disk);
    const auto entry = store.put(called("one"));
    ASSERT_TRUE(entry && store.set_in_force(entry->id));
    good = entry->file;
  }
  const auto bytes = disk.read(good, kMaxCalibrationBytes);
  ASSERT_TRUE(bytes);
  const std::string folder = good.substr(0, good.find('/') + 1), name = good.substr(good.find('/') + 1);
  const std::string hex = name.substr(9, 64);
  std::vector<std::string> others;
  for (const std::string& other :
       {"00000002-g" + hex.substr(1) + ".json", "00000002-" + hex.substr(0, 63) + "g.json",
        "00000002-" + hex.substr(1) + ".json", "0000002-" + hex + ".json", "0000000x-" + hex + ".json",
        "00000002-" + hex + ".jsonx", "00000002" + hex + ".json"}) {
    others.push_back(folder + other);
    write(disk, others.back(), *bytes);
  }
  CalibrationStore store = store_on(disk);
  EXPECT_EQ(store.entries().size(), 1u);
  EXPECT_EQ(store.note(), "");
  ASSERT_TRUE(store.set_in_force(store.entries().front().id));
  for (const std::string& other : others) EXPECT_TRUE(disk.size(other)) << other;
}

TEST(CalibrationStoreLimits, TwoAreDamaged_TheNoteNamesBothInOneSentence) {
  SimDisk disk;
  std::vector<CalibrationStore::Entry> entries;
  {
    CalibrationStore store = store_on(disk);
    for (const char* name : {"one", "two", "three"}) ASSERT_TRUE(store.put(called(name)));
    entries = store.entries();
  }
  for (std::size_t i = 0; i < 2; ++i) {
    auto bytes = disk.read(entries[i].file, kMaxCalibrationBytes);
    ASSERT_TRUE(bytes);
    bytes->at(bytes->size() / 2) ^= 1;
    write(disk, entries[i].file, *bytes);
  }
  const CalibrationStore store = store_on(disk);
  EXPECT_EQ(store.entries().size(), 1u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NE(store.note().find(to_hex(entries[i].id).substr(0, 12)), std::string::npos) << store.note();
  }
  EXPECT_NE(store.note().find("; "), std::string::npos) << store.note();
  EXPECT_FALSE(store.note().starts_with(";"));
}

TEST(CalibrationStoreLimits, EveryWayToAskForOneThatIsNotStored_IsNotFound) {
  SimDisk disk;
  CalibrationStore store = store_on(disk);
  ASSERT_TRUE(store.put(called("one")));
  const Sha256 other = calibration_id(called("two"));
  EXPECT_EQ(store.read(other).error().code, Errc::kNotFound);
  EXPECT_EQ(store.load(other).error().code, Errc::kNotFound);
  EXPECT_EQ(store.original(other).error().code, Errc::kNotFound);
  EXPECT_EQ(store.set_in_force(other).error().code, Errc::kNotFound);
}

}  // namespace
}  // namespace nodal::firmware
