// Takes on a simulated disk: written, cut by a power failure at every operation, recovered.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "firmware/record/recovery.h"
#include "firmware/record/take_writer.h"
#include "firmware/replay/take_reel.h"
#include "hal/sim/disk.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "stitch/media/image_file.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/media/thumbnail.h"
#include "take_film.h"
#include "tests/support/matroska_elements.h"

namespace nodal::firmware {
namespace {

using namespace take_film;

TEST(Takes, WrittenToTheEnd_HoldsEveryPictureAndItsHashes) {
  hal::sim::SimDisk disk;
  const Film made = film(10);
  EXPECT_EQ(record(disk, made, true), 40U);
  const Bytes text = read(disk, take::kManifestFile);
  const auto manifest = take::parse_manifest({reinterpret_cast<const char*>(text.data()), text.size()}, "manifest");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(manifest->files.size(), 8U) << "three heads, raymaps, evidence, calibration.json, rig.toml, take.json";
  EXPECT_EQ(check(disk, *manifest), 40U);
}

/// 64 x 32 pixels, red on the left and blue on the right.
Bytes red_and_blue() {
  constexpr int kWide = 64, kHigh = 32;
  Bytes pixels, jpeg;
  for (int p = 0; p < kWide * kHigh; ++p) {
    const bool left = p % kWide < kWide / 2;
    pixels.insert(pixels.end(),
                  {static_cast<std::uint8_t>(left ? 220 : 20), 20, static_cast<std::uint8_t>(left ? 20 : 220)});
  }
  media::JpegWriter writer({.width = kWide, .height = kHigh, .quality = 95});
  EXPECT_TRUE(writer.write(packed_image(PixelFormat::kRgb24, kWide, kHigh, std::as_const(pixels).data()), "", jpeg));
  return jpeg;
}

TEST(Takes, TheFirstRaymap_IsTheThumbnailAnEighthAsWide) {
  hal::sim::SimDisk disk;
  Film made = film(10);
  const Bytes raymap = red_and_blue();
  made.rows[1].raymaps[0].jpeg = raymap;
  made.rows[0].raymaps.clear();  // the disk was slow
  EXPECT_EQ(record(disk, made, true), 40U);
  const Bytes text = read(disk, take::kManifestFile);
  const auto manifest = take::parse_manifest({reinterpret_cast<const char*>(text.data()), text.size()}, "manifest");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(std::ranges::count(manifest->files, take::kThumbFile, &take::Manifest::File::name), 1);
  EXPECT_EQ(check(disk, *manifest), 40U);
  const auto small = media::decode_image(read(disk, take::kThumbFile), "thumb.jpg", PixelFormat::kRgb24);
  ASSERT_TRUE(small) << small.error().text();
  ASSERT_EQ(small->width, 8);
  ASSERT_EQ(small->height, 4);
  for (std::size_t p = 0; p < 32; ++p) {
    if (p % 8 == 3 || p % 8 == 4) continue;  // the JPEG smears the edge
    EXPECT_NEAR(small->bytes[3 * p], p % 8 < 4 ? 220 : 20, 30) << p;
    EXPECT_NEAR(small->bytes[3 * p + 2], p % 8 < 4 ? 20 : 220, 30) << p;
  }
}

TEST(Takes, PowerCutWhileTheThumbnailIsWritten_ItIsWholeOrNotThere) {
  Film made = film(4);
  const Bytes raymap = red_and_blue();
  made.rows[0].raymaps[0].jpeg = raymap;
  hal::sim::SimDisk counted;
  record(counted, made, true);
  int complete = 0, torn = 0;
  for (std::uint64_t k = 0; k < counted.operations(); ++k) {
    hal::sim::SimDisk disk(k);
    disk.die_at(k);
    record(disk, made, true);
    const auto left = disk.after_power_loss(k + 1);
    if (!left->size("000042/" + take::kTakeFile)) continue;
    const auto before = left->read("000042/" + take::kThumbFile, 1 << 20);
    torn += before && !media::is_whole_jpeg(*before) ? 1 : 0;
    if (!left->size("000042/" + take::kManifestFile)) {
      const auto manifest = recover_take(*left, "000042");
      ASSERT_TRUE(manifest) << "operation " << k;
      EXPECT_EQ(std::ranges::count(manifest->files, take::kThumbFile, &take::Manifest::File::name),
                left->size("000042/" + take::kThumbFile) ? 1 : 0)
          << "operation " << k;
    }
    const auto after = left->read("000042/" + take::kThumbFile, 1 << 20);
    if (!after) continue;
    ++complete;
    EXPECT_TRUE(media::decode_image(*after, "thumb.jpg")) << "operation " << k;
  }
  EXPECT_GT(complete, 0);
  EXPECT_GT(torn, 0) << "no power cut tore the thumbnail";
}

TEST(Takes, PowerCutAtAnyOperation_LosesAtMostWhatWasNotSynced) {
  const Film made = film(12);
  hal::sim::SimDisk counted;
  record(counted, made, true);
  const std::uint64_t operations = counted.operations();
  ASSERT_GT(operations, 60U);
  int recovered = 0, ended = 0;
  for (std::uint64_t k = 0; k < operations; ++k) {
    for (std::uint64_t seed = 0; seed < 64; ++seed) {
      SCOPED_TRACE("operation " + std::to_string(k) + " seed " + std::to_string(seed));
      hal::sim::SimDisk disk(seed);
      disk.die_at(k);
      const std::uint64_t durable = record(disk, made, true);
      const auto left = disk.after_power_loss(seed + 1);
      if (!left->size("000042/" + take::kTakeFile)) {
        EXPECT_EQ(durable, 0U);
        continue;
      }
      const auto stored = left->read("000042/" + take::kManifestFile, 1 << 20);
      if (stored) {
        const auto manifest =
            take::parse_manifest({reinterpret_cast<const char*>(stored->data()), stored->size()}, "manifest");
        ASSERT_TRUE(manifest) << manifest.error().text();
        EXPECT_EQ(check(*left, *manifest), 48U);
        ++ended;
        continue;
      }
      const auto manifest = recover_take(*left, "000042");
      ASSERT_TRUE(manifest) << manifest.error().text();
      EXPECT_GE(check(*left, *manifest), durable);
      ++recovered;
    }
  }
  EXPECT_GT(recovered, 100);
  EXPECT_GT(ended, 0);
}

TEST(Takes, PowerCutDuringTheRecovery_IsRecoveredByTheNext) {
  const Film made = film(7);
  for (std::uint64_t k = 0; k < 40; ++k) {
    SCOPED_TRACE("operation " + std::to_string(k));
    hal::sim::SimDisk disk(k);
    disk.die_at(35);
    const std::uint64_t durable = record(disk, made, true);
    const auto first = disk.after_power_loss(k);
    first->die_at(k);
    (void)recover_take(*first, "000042");
    const auto second = first->after_power_loss(k + 1);
    if (second->size("000042/" + take::kManifestFile)) continue;
    const auto manifest = recover_take(*second, "000042");
    ASSERT_TRUE(manifest) << manifest.error().text();
    EXPECT_GE(check(*second, *manifest), durable);
  }
}

TEST(Takes, Killed_LosesOnlyTheRowBeingWritten) {
  const Film made = film(9);
  hal::sim::SimDisk disk;
  record(disk, made, false);
  const auto left = disk.after_kill();
  const auto manifest = recover_take(*left, "000042");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(check(*left, *manifest), 36U);
}

constexpr std::uint32_t kMatroskaSegment = 0x18538067, kMatroskaCluster = 0x1F43B675, kMatroskaCues = 0x1C53BB6B;

/// The times of a file's clusters, in 1/100 ms, and of the entries of its index.
struct ClusterTimes {
  std::vector<std::uint64_t> clusters, index;
};
ClusterTimes times_of(const Bytes& file) {
  ClusterTimes times;
  const test::Element ebml = test::element_at(file, 0, file.size()).value();
  const test::Element segment = test::element_at(file, ebml.content + ebml.size, file.size()).value();
  EXPECT_EQ(segment.id, kMatroskaSegment);
  for (const test::Element& each : test::children(file, segment)) {
    if (each.id == kMatroskaCluster) times.clusters.push_back(test::value_of(file, *test::child(file, each, 0xE7)));
    if (each.id != kMatroskaCues) continue;
    for (const test::Element& point : test::children(file, each)) {
      times.index.push_back(test::value_of(file, *test::child(file, point, 0xB3)));
    }
  }
  return times;
}

TEST(Takes, EveryFile_HasClustersAtTheTimesOfTheirSetsAndAnIndexOfThem) {
  const Film made = film(9);
  hal::sim::SimDisk ended;
  record(ended, made, true);
  hal::sim::SimDisk torn;
  record(torn, made, false);
  const auto recovered = torn.after_kill();
  ASSERT_TRUE(recover_take(*recovered, "000042"));
  for (hal::DiskPort* disk : {static_cast<hal::DiskPort*>(&ended), static_cast<hal::DiskPort*>(recovered.get())}) {
    for (const char* name : {"cam0-0000.mkv", "cam2-0000.mkv", "raymap-0000.mkv"}) {
      const ClusterTimes times = times_of(read(*disk, name));
      std::vector<std::uint64_t> rows;
      for (std::uint64_t r = 0; r < made.rows.size(); ++r) rows.push_back(r * kSetsARow * kTakePeriod.ms() * 100);
      EXPECT_EQ(times.clusters, rows) << name;
      EXPECT_EQ(times.index, rows) << name;
    }
  }
}

TEST(Takes, TheFlightRecordCannotBeMade_TheTakeIsWholeWithoutIt) {
  const Film made = film(3);
  hal::sim::SimDisk disk;
  auto writer = TakeWriter::begin(disk, documents());
  ASSERT_TRUE(writer);
  disk.fail_at(disk.operations());
  const Bytes events(100, 'e');
  for (const TakeRow& row : made.rows) {
    (*writer)->write_flight(events);
    ASSERT_TRUE((*writer)->write(row));
  }
  const auto manifest = (*writer)->end("stopped");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(check(disk, *manifest), made.rows.size() * kSetsARow);
}

TEST(Takes, FailedSync_IsNotRepeatedAndANewSegmentBegins) {
  const Film made = film(8);
  hal::sim::SimDisk disk;
  auto writer = TakeWriter::begin(disk, documents());
  ASSERT_TRUE(writer);
  std::size_t r = 0;
  for (; r < 4; ++r) {
    ASSERT_TRUE((*writer)->write(made.rows[r]));
    if (r == 1) {
      ASSERT_TRUE((*writer)->sync(Instant(), 0));
    }
  }
  disk.fail_syncs(1);
  EXPECT_FALSE((*writer)->sync(Instant(), 0));
  EXPECT_EQ((*writer)->sets(), 8U) << "the two rows before the last good sync";
  for (; r < 8; ++r) ASSERT_TRUE((*writer)->write(made.rows[r]));
  const auto manifest = (*writer)->end("stopped");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(check(disk, *manifest), 24U);
}

TEST(Takes, DiskGoneWhileASegmentIsCut_NothingIsFinishedUntilItIsBackAndThenNothingIsMissing) {
  const Film made = film(8);
  for (const bool back_at_once : {false, true}) {
    hal::sim::SimDisk disk;
    auto writer = TakeWriter::begin(disk, documents());
    ASSERT_TRUE(writer);
    for (std::size_t r = 0; r < 5; ++r) {
      ASSERT_TRUE((*writer)->write(made.rows[r]));
      if (r == 3) {
        ASSERT_TRUE((*writer)->sync(Instant(), 0));
      }
    }
    disk.unplug();
    EXPECT_FALSE((*writer)->sync(Instant(), 0));
    EXPECT_FALSE((*writer)->write(made.rows[5]));
    if (back_at_once) disk.unplug(false);
    const auto ended = (*writer)->end("disk failed", {0, 24});
    EXPECT_EQ(ended.has_value(), back_at_once);
    disk.unplug(false);
    EXPECT_EQ(disk.read("000042/manifest", 1 << 20).has_value(), back_at_once);
    const auto manifest = back_at_once ? ended : recover_take(disk, "000042");
    ASSERT_TRUE(manifest) << manifest.error().text();
    EXPECT_GE(check(disk, *manifest), 16U) << "the durable rows";
    if (back_at_once) {
      EXPECT_EQ(manifest->sets + manifest->lost_sets, 24U);
    }
  }
}

TEST(Takes, AMarkBeforeTheFirstSet_IsThatOfTheFirstSet) {
  const Film made = film(3);
  hal::sim::SimDisk disk;
  auto writer = TakeWriter::begin(disk, documents());
  ASSERT_TRUE(writer);
  EXPECT_TRUE((*writer)->mark("early", Instant()));
  for (const TakeRow& row : made.rows) ASSERT_TRUE((*writer)->write(row));
  EXPECT_TRUE((*writer)->mark("late", Instant()));
  const auto manifest = (*writer)->end("stopped");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(manifest->marks, (std::vector<take::Manifest::Mark>{{0, "early"}, {12, "late"}}));
  EXPECT_EQ(check(disk, *manifest), 12U);
}

TEST(Takes, DiskFull_WhatIsWholeIsKept) {
  const Film made = film(20);
  for (const std::uint64_t capacity : {20'000U, 30'000U, 45'000U, 52'345U}) {
    SCOPED_TRACE(capacity);
    hal::sim::SimDisk disk(1, capacity);
    auto writer = TakeWriter::begin(disk, documents());
    ASSERT_TRUE(writer);
    Status good;
    for (std::size_t r = 0; r < made.rows.size() && good; ++r) good = (*writer)->write(made.rows[r]);
    ASSERT_FALSE(good);
    EXPECT_EQ(good.error().code, Errc::kDiskFull);
    disk.set_capacity(capacity + 10'000);  // the reserve
    const auto manifest = (*writer)->end("disk full");
    ASSERT_TRUE(manifest) << manifest.error().text();
    EXPECT_GT(check(disk, *manifest), 0U);
  }
}

TEST(Takes, AHeadChangesItsFormat_ANewSegmentBegins) {
  Film made = film(6);
  Film other = film(6, kTakeHeight * 2);
  hal::sim::SimDisk disk;
  auto writer = TakeWriter::begin(disk, documents());
  ASSERT_TRUE(writer);
  for (std::size_t r = 0; r < 3; ++r) ASSERT_TRUE((*writer)->write(made.rows[r]));
  for (std::size_t r = 3; r < 6; ++r) ASSERT_TRUE((*writer)->write(other.rows[r]));
  const auto manifest = (*writer)->end("stopped");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(manifest->files.size(), 13U) << "two segments of five files, and three documents";
  EXPECT_EQ(manifest->sets, 24U);
}

/// The film of 10 rows as a take on a disk of its own.
std::unique_ptr<hal::sim::SimDisk> disk_with_take() {
  auto disk = std::make_unique<hal::sim::SimDisk>();
  EXPECT_EQ(record(*disk, film(10), true), 40U);
  return disk;
}

TEST(TakeReel, EveryHead_HasItsPicturesInOrderAndAGapWhereItIsMissing) {
  for (std::size_t head = 0; head < kTakeHeads; ++head) {
    const auto reel = open_take_reel(disk_with_take(), "000042", "take", std::string(1, static_cast<char>('a' + head)));
    ASSERT_TRUE(reel) << reel.error().text();
    ASSERT_EQ((*reel)->size(), 40U);
    EXPECT_EQ((*reel)->format(), head == 2 ? PixelFormat::kMjpeg : PixelFormat::kGrey8);
    EXPECT_EQ((*reel)->rate(), (FrameRate{30, 1}));
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < 40; ++i) order.push_back(i);
    for (const std::size_t i : {7, 8, 3, 39, 0}) order.push_back(i);  // forward, back, and from the end to the start
    for (const std::size_t i : order) {
      const hal::replay::Shot shot = (*reel)->shot(i);
      const std::uint64_t set = 100 + i;
      EXPECT_EQ(shot.present, !(set % 11 == 3 && head == 1)) << i;
      if (!shot.present) continue;
      ASSERT_TRUE(shot.picture) << i;
      EXPECT_EQ(shot.picture->bytes, picture(set, head)) << i;
    }
  }
}

TEST(TakeReel, AChangedByte_IsAFrameThatCannotBeReadAndTheOthersAreGood) {
  auto disk = disk_with_take();
  const std::string name = "000042/cam0-0000.mkv";
  Bytes bytes = disk->read(name, 1 << 24).value();
  bytes[bytes.size() / 2] ^= 1;
  disk->put(name, bytes);
  const auto reel = open_take_reel(std::move(disk), "000042", "take", "a");
  ASSERT_TRUE(reel) << reel.error().text();
  for (std::size_t i = 0; i < 40; ++i) {
    const hal::replay::Shot shot = (*reel)->shot(i);
    EXPECT_TRUE(shot.present);
    // The file is smaller than the piece of a hash, so that no picture of it can be trusted.
    EXPECT_EQ(shot.picture, nullptr);
  }
}

TEST(TakeReel, WhatCannotBePlayed_IsNamed) {
  const auto nobody = open_take_reel(disk_with_take(), "000042", "take", "d");
  ASSERT_FALSE(nobody);
  EXPECT_NE(nobody.error().message.find("no head 'd'; it has a, b, c"), std::string::npos) << nobody.error().text();
  const auto nowhere = open_take_reel(disk_with_take(), "000041", "take", "a");
  ASSERT_FALSE(nowhere);
  EXPECT_NE(nowhere.error().message.find("take.json"), std::string::npos) << nowhere.error().text();
  auto disk = std::make_unique<hal::sim::SimDisk>();
  record(*disk, film(4), false);
  const auto open = open_take_reel(std::move(disk), "000042", "take", "a");
  ASSERT_FALSE(open);
  EXPECT_EQ(open.error().code, Errc::kNotReady) << open.error().text();
}

}  // namespace
}  // namespace nodal::firmware
