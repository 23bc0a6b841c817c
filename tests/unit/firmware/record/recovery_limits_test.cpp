// Takes that are whole, torn, strange or on a failing disk, recovered: what is written, every reader accepts.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "firmware/record/recovery.h"
#include "firmware/record/stored_documents.h"
#include "hal/sim/disk.h"
#include "protocol/framing.h"
#include "protocol/take/limits.h"
#include "stitch/media/take/take_folder.h"
#include "take_film.h"
#include "tests/support/failing_disk.h"

namespace nodal::firmware {
namespace {

using namespace take_film;
using hal::sim::SimDisk;
namespace wire = take::wire;

class FilesOn final : public media::TakeFiles {
 public:
  explicit FilesOn(SimDisk& disk) : disk_(disk) {}
  Result<std::unique_ptr<media::TakeFile>> open(const std::string& name) override {
    auto bytes = disk_.read("000042/" + name, 1 << 26);
    if (!bytes) return fail(bytes.error());
    return std::make_unique<File>(std::move(*bytes));
  }
  std::string shown(const std::string& name) const override { return "000042/" + name; }

 private:
  class File final : public media::TakeFile {
   public:
    explicit File(Bytes bytes) : bytes_(std::move(bytes)) {}
    std::uint64_t size() const override { return bytes_.size(); }
    Status read(std::uint64_t at, std::span<std::uint8_t> into) override {
      if (at > bytes_.size() || into.size() > bytes_.size() - at) return fail(Errc::kTruncated, "ends before");
      std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), into.size(), into.begin());
      return {};
    }

   private:
    Bytes bytes_;
  };
  SimDisk& disk_;
};

/// Reads every set and picture; the first error.
Status read_all(SimDisk& disk) {
  const auto folder = media::TakeFolder::open(std::make_shared<FilesOn>(disk));
  if (!folder) return fail(folder.error());
  media::TakeSets sets(*folder);
  media::TakeSet set;
  for (;;) {
    const Result<bool> more = sets.next(set);
    if (!more) return fail(more.error());
    if (!*more) return {};
    if (const Status read = sets.read_pictures(set); !read) return read;
  }
}

std::vector<wire::Record> records_of(const Bytes& bytes) {
  std::vector<wire::Record> records;
  FrameDecoder decoder;
  std::span<const std::uint8_t> rest(bytes);
  while (!rest.empty()) {
    const auto frame = decoder.next(rest);
    if (!frame || !*frame) break;
    records.emplace_back().ParseFromArray((*frame)->payload.data(), static_cast<int>((*frame)->payload.size()));
  }
  return records;
}

void put(SimDisk& disk, const std::string& name, const Bytes& bytes) {
  RC_ASSERT(disk.remove("000042/" + name).has_value());
  const auto file = disk.create("000042/" + name);
  RC_ASSERT(file.has_value());
  RC_ASSERT(disk.write(*file, bytes).has_value());
  disk.close(*file);
}

wire::Record mark(std::uint64_t set, const std::string& text) {
  wire::Record record;
  record.mutable_mark()->set_set(set);
  record.mutable_mark()->set_text(text);
  return record;
}

const std::vector<std::uint64_t> kStrange{
    0, 1, std::uint64_t{1} << 32, take::kMaxSets, take::kMaxSets + 1, INT64_MAX, std::uint64_t{1} << 63, UINT64_MAX};

/// Changes one thing in the evidence to what no rig writes.
void spoil(std::vector<wire::Record>& records) {
  const auto value = *rc::gen::elementOf(kStrange);
  const auto at = *rc::gen::inRange<std::size_t>(1, records.size() + 1);
  const auto set = std::ranges::find_if(records.begin() + static_cast<std::ptrdiff_t>(at) - 1, records.end(),
                                        [](const wire::Record& record) { return record.has_set(); });
  const auto here = records.begin() + static_cast<std::ptrdiff_t>(at);
  switch (*rc::gen::inRange(0, 9)) {
    case 0: records.insert(here, mark(value, "\x1b[2J\n\x07 red")); return;
    case 1: records.insert(here, take::kMaxMarks + 1, mark(3, std::string(5, '\0') + std::string(300, 'm'))); return;
    case 2: records.front().mutable_begin()->set_first_set(value); return;
    case 3: records.front().mutable_begin()->set_segment(static_cast<std::uint32_t>(value)); return;
    case 4: records.front().mutable_begin()->set_rate_numerator(static_cast<std::uint32_t>(value)); return;
    case 5: {
      wire::Calibration& calibration = *records.insert(here, wire::Record())->mutable_calibration();
      calibration.set_file("calibration-0001.json");
      calibration.set_id(std::string(64, 'a'));
      calibration.set_set(value);
      return;
    }
    default: break;
  }
  if (set == records.end()) return;
  wire::Set& stored = *set->mutable_set();
  switch (*rc::gen::inRange(0, 5)) {
    case 0: stored.set_number(value); return;
    case 1: stored.set_mid_exposure_ns(static_cast<std::int64_t>(value)); return;
    case 2: stored.set_missed(value); return;
    case 3: stored.mutable_frames(0)->set_bytes(value); return;
    default: stored.mutable_frames(0)->set_placeholder("\x1b[31m"); return;
  }
}

RC_GTEST_PROP(RecoveryLimits, WhateverATakeHolds_WhatIsWrittenEveryReaderAccepts, ()) {
  SimDisk disk;
  const Film made = film(*rc::gen::inRange(2, 10));
  record(disk, made, *rc::gen::arbitrary<bool>());
  (void)disk.remove("000042/manifest");
  const int changes = *rc::gen::inRange(0, 4);
  for (int k = 0; k < changes; ++k) {
    if (*rc::gen::arbitrary<bool>()) {
      const auto names = disk.list("000042").value();
      const std::string name = *rc::gen::elementOf(names);
      if (name == take::kTakeFile) continue;
      Bytes bytes = read(disk, name);
      bytes.resize(*rc::gen::inRange<std::size_t>(0, bytes.size() + 1));
      put(disk, name, bytes);
      continue;
    }
    std::vector<wire::Record> records = records_of(read(disk, "evidence-0000"));
    if (records.empty()) continue;
    spoil(records);
    take::EvidenceWriter writer;
    Bytes bytes;
    for (const wire::Record& each : records) {
      const Bytes one = writer.encode(each);
      bytes.insert(bytes.end(), one.begin(), one.end());
    }
    put(disk, "evidence-0000", bytes);
  }
  const auto manifest = recover_take(disk, "000042");
  if (!manifest) {
    RC_ASSERT(!manifest.error().message.empty());
    RC_ASSERT(!disk.size("000042/manifest").has_value());
    return;
  }
  const Status all = read_all(disk);
  if (!all) RC_FAIL(all.error().text());
}

TEST(RecoveryLimits, MoreMarksThanThereMayBe_TheFirstAreKeptAndTheManifestSaysSo) {
  SimDisk disk;
  record(disk, film(6), true);
  ASSERT_TRUE(disk.remove("000042/manifest"));
  std::vector<wire::Record> records = records_of(read(disk, "evidence-0000"));
  for (std::size_t k = 0; k < take::kMaxMarks + 3; ++k) records.insert(records.begin() + 1, mark(UINT64_MAX, "a\nb"));
  take::EvidenceWriter writer;
  Bytes bytes;
  for (const wire::Record& each : records) {
    const Bytes one = writer.encode(each);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  ASSERT_TRUE(disk.remove("000042/evidence-0000"));
  const auto file = disk.create("000042/evidence-0000");
  ASSERT_TRUE(file && disk.write(*file, bytes));
  disk.close(*file);
  const auto manifest = recover_take(disk, "000042");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(manifest->marks.size(), take::kMaxMarks);
  EXPECT_EQ(manifest->marks[0].text, "a?b");
  EXPECT_EQ(manifest->sets, 24U);
  EXPECT_TRUE(read_all(disk)) << read_all(disk).error().text();
}

/// The file's end cannot be read; nobody knows that it is what was recorded.
TEST(RecoveryLimits, APieceThatCannotBeRead_IsNotTakenForVerified) {
  SimDisk disk;
  record(disk, film(6), true);
  ASSERT_TRUE(disk.remove("000042/manifest"));
  const std::uint64_t bytes = disk.size("000042/cam0-0000.mkv").value();
  disk.spoil("000042/cam0-0000.mkv", bytes - 20);
  const auto manifest = recover_take(disk, "000042");
  ASSERT_TRUE(manifest) << manifest.error().text();
  disk.spoil("", 0);
  const auto evidence = take::read_evidence(read(disk, "evidence-0000"), "evidence-0000");
  ASSERT_TRUE(evidence && evidence->end);
  EXPECT_EQ(evidence->end->reason(), "recovered") << "its end was written anew";
  EXPECT_EQ(manifest->sets, 24U);
  EXPECT_TRUE(read_all(disk));
}

TEST(RecoveryLimits, TheDiskFailsAtAnyCall_TheNextRecoveryHasAllThatIsThere) {
  SimDisk recorded;
  record(recorded, film(8), false);
  std::uint64_t expected = 0, failures = 0;
  {
    const auto disk = recorded.after_kill();
    expected = recover_take(*disk, "000042").value().sets;
    ASSERT_GT(expected, 0U);
  }
  for (std::uint64_t call = 0;; ++call) {
    const auto disk = recorded.after_kill();
    const std::uint64_t before = disk->operations();
    disk->fail_at(before + call);
    const auto first = recover_take(*disk, "000042");
    if (disk->operations() - before <= call) break;  // it makes no such call
    failures += first ? 0 : 1;
    // A manifest that is there is the take's, also if the folder could not be synced after it.
    const bool present = disk->size("000042/manifest").has_value();
    const auto manifest = first ? first : present ? stored_manifest(*disk, "000042") : recover_take(*disk, "000042");
    ASSERT_TRUE(manifest) << "call " << call << ": " << manifest.error().text();
    EXPECT_EQ(manifest->sets, expected) << "call " << call;
    EXPECT_EQ(check(*disk, *manifest), expected) << "call " << call;
    EXPECT_TRUE(read_all(*disk)) << "call " << call;
  }
  EXPECT_GT(failures, 5U);
}

/// One that fails once may work the next time, so nothing is given up for it.
TEST(RecoveryLimits, AnyOpenOrReadFailsOnce_NothingIsLostAndTheErrorNamesTheFile) {
  SimDisk recorded;
  record(recorded, film(8), false);
  std::uint64_t expected = 0, failures = 0;
  {
    const auto disk = recorded.after_kill();
    expected = recover_take(*disk, "000042").value().sets;
  }
  for (std::uint64_t call = 0;; ++call) {
    const auto disk = recorded.after_kill();
    test::FailingDisk failing(*disk, call);
    const auto first = recover_take(failing, "000042");
    if (failing.calls() <= call) break;  // it makes no such call
    if (!first) {
      ++failures;
      EXPECT_NE(first.error().message.find(failing.failed()), std::string::npos)
          << "call " << call << ", of " << failing.failed() << ": " << first.error().message;
    }
    const bool present = disk->size("000042/manifest").has_value();
    const auto manifest = first ? first : present ? stored_manifest(*disk, "000042") : recover_take(*disk, "000042");
    ASSERT_TRUE(manifest) << "call " << call << ", of " << failing.failed() << ": " << manifest.error().text();
    EXPECT_EQ(manifest->sets, expected) << "call " << call << ", of " << failing.failed();
    EXPECT_EQ(check(*disk, *manifest), expected) << "call " << call;
    EXPECT_TRUE(read_all(*disk)) << "call " << call;
  }
  EXPECT_GT(failures, 5U);
}

}  // namespace
}  // namespace nodal::firmware
