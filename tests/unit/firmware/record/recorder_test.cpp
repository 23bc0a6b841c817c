// The recorder, fed with sets by hand and read as the disk's stage does.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "firmware/record/recorder.h"
#include "hal/sim/clock.h"

namespace nodal::firmware {
namespace {

constexpr int kHeadWidth = 640, kHeadHeight = 480;

RigConfig config(int heads, TakeMode mode) {
  RigConfig config;
  config.heads.resize(static_cast<std::size_t>(heads));
  for (HeadConfig& head : config.heads) head.take_mode = mode;
  config.raymap.width = 64;
  config.raymap.height = 32;
  config.takes = TakesConfig{.folder = "takes", .buffer_mb = 16};
  return config;
}

class Stand {
 public:
  explicit Stand(int heads, TakeMode mode = TakeMode::kDriver)
      : heads_(heads), config_(config(heads, mode)), recorder_(config_, sets_in_, encoder_) {
    for (int head = 0; head < heads; ++head)
      pixels_.emplace_back(kHeadWidth * kHeadHeight, static_cast<std::uint8_t>(head + 1));
    begin(false);
  }
  void begin(bool still) {
    EXPECT_TRUE(recorder_.orders().push({RecordOrder::Kind::kBegin, 7, true, still}));
    recorder_.step();
  }
  void end() {
    EXPECT_TRUE(recorder_.orders().push({RecordOrder::Kind::kEnd, 7, false, false}));
    recorder_.step();
  }
  ~Stand() {
    while (auto row = recorder_.rows().pop()) {}
  }

  /// A set 10 ms after the one before it.
  void offer(HeadMask mask, int height = kHeadHeight) {
    SetLoan loan = pool_.take();
    ASSERT_TRUE(loan);
    FrameSet& set = loan.edit();
    set = {};
    set.number = next_;
    set.mid_exposure =
        Instant::from_ns(1'000'000'000) + Duration::milliseconds(10) * static_cast<std::int64_t>(next_++);
    set.mask = mask;
    for (std::size_t head = 0; head < static_cast<std::size_t>(heads_); ++head) {
      set.frames[head].image =
          packed_image(PixelFormat::kGrey8, kHeadWidth, height, std::as_const(pixels_[head]).data());
    }
    sets_in_.offer(loan);
    loan = {};
    recorder_.step();
    EXPECT_TRUE(pool_.collect() || pool_.lent() == 0) << "the set goes back at once";
  }
  void offer_raymap() { offer_raymap_of(next_); }
  std::uint64_t newest() const { return next_ - 1; }
  void offer_raymap_of(std::uint64_t set) {
    PixelsLoan pixels = pixels_pool_.take();
    ASSERT_TRUE(pixels);
    pixels.edit().resize(64 * 32 * 3 / 2);
    Raymap raymap;
    raymap.info.set = set;
    raymap.pixels = std::move(pixels);
    ASSERT_TRUE(raymaps_.push(std::move(raymap)));
    ASSERT_TRUE(encoder_.step());
    (void)encoder_.published().take();
    recorder_.step();
  }
  std::unique_ptr<TakeRow> take_row() { return recorder_.rows().pop().value_or(nullptr); }
  void give_back(std::unique_ptr<TakeRow> row) {
    recorder_.ring().release(row->ring_end);
    EXPECT_TRUE(recorder_.rows_back().push(std::move(row)));
  }
  Recorder& recorder() { return recorder_; }

 private:
  int heads_;
  RigConfig config_;
  hal::sim::SimClock clock_;
  LoanPool<FrameSet> pool_{8};
  Outlet<SetLoan> sets_in_{Recorder::kSets, false};
  LoanPool<LineVector> pixels_pool_{4};
  SpscRing<Raymap> raymaps_{4};
  EncodeStage encoder_{config_.raymap, clock_, raymaps_};
  std::vector<std::vector<std::uint8_t>> pixels_;
  Recorder recorder_;
  std::uint64_t next_ = 0;
};

TEST(Recorder, SetsOfAQuarterSecond_AreARowWithTheHeadsPictures) {
  Stand stand(2);
  for (int k = 0; k < 14; ++k) stand.offer(3);
  const auto row = stand.take_row();
  ASSERT_TRUE(row) << "a cluster of 4 MiB has 13 pictures";
  EXPECT_EQ(row->sets.size(), 13U);
  EXPECT_EQ(row->take, 7U);
  for (const RecordedSet& set : row->sets) {
    for (std::size_t head = 0; head < 2; ++head) {
      EXPECT_EQ(set.frames[head].placeholder, Placeholder::kNone);
      EXPECT_EQ(set.frames[head].bytes.size(), static_cast<std::size_t>(kHeadWidth * kHeadHeight));
      EXPECT_EQ(set.frames[head].bytes.front(), head + 1);
      EXPECT_EQ(set.frames[head].bytes.back(), head + 1);
    }
  }
}

TEST(Recorder, AHeadWithoutAFrame_HasAPlaceholder) {
  Stand stand(2);
  stand.offer(3);
  for (int k = 0; k < 14; ++k) stand.offer(1);
  const auto row = stand.take_row();
  ASSERT_TRUE(row);
  EXPECT_EQ(row->sets[0].frames[1].placeholder, Placeholder::kNone);
  EXPECT_EQ(row->sets[1].frames[1].placeholder, Placeholder::kMissing);
  EXPECT_EQ(stand.recorder().counts().placeholders.load(), 14U);
}

TEST(Recorder, AnotherFormat_IsAPlaceholderForASecondAndThenANewRow) {
  Stand stand(1);
  for (int k = 0; k < 50; ++k) stand.offer(1);
  for (int k = 0; k < 70; ++k) stand.offer(1, kHeadHeight / 2);
  std::uint64_t other = 0, placeholders = 0;
  while (auto row = stand.take_row()) {
    for (const RecordedSet& set : row->sets) {
      if (set.frames[0].placeholder == Placeholder::kFormat) ++placeholders;
      else if (row->streams[0]->height == kHeadHeight / 2) ++other;
    }
    stand.give_back(std::move(row));
  }
  EXPECT_EQ(placeholders, 50U) << "until 1 s after the first picture";
  EXPECT_GT(other, 0U);
}

TEST(Recorder, ASlowDisk_LosesRaymapsFirstAndThenWholeSets) {
  Stand stand(2);
  const std::size_t fit = (std::size_t{16} << 20) / (2 * kHeadWidth * kHeadHeight);
  for (std::size_t k = 0; k < fit + 20; ++k) {
    stand.offer(3);
    if (k % 5 != 0) continue;
    stand.offer_raymap();
    const Recorder::Counts& counts = stand.recorder().counts();
    if (k < fit / 2 - 1) {
      EXPECT_EQ(counts.lost_raymaps.load(), 0U) << "set " << k;
    }
    if (k > fit / 2 + 5) {
      EXPECT_GT(counts.lost_raymaps.load(), 0U) << "set " << k;
    }
    if (k < fit - 2) {
      EXPECT_EQ(counts.lost_sets.load(), 0U) << "set " << k;
    }
  }
  const std::uint64_t lost = stand.recorder().counts().lost_sets.load();
  EXPECT_GE(lost, 18U);
  EXPECT_LE(lost, 22U);
  // The disk goes on: the next recorded set says how many are missing before it.
  std::uint64_t sets = 0, missed = 0, next = 0, raymaps = 0;
  for (int round = 0; round < 3; ++round) {
    while (auto row = stand.take_row()) {
      raymaps += row->raymaps.size();
      for (const RecordedSet& set : row->sets) {
        EXPECT_EQ(set.number, next + set.missed);
        next = set.number + 1;
        missed += set.missed;
        ++sets;
      }
      stand.give_back(std::move(row));
    }
    for (int k = 0; k < 20; ++k) stand.offer(3);
  }
  EXPECT_EQ(missed, lost);
  EXPECT_GT(sets, fit - 2);
  EXPECT_GE(raymaps, fit / 10);
}

TEST(Recorder, TheEnd_ClosesTheLastRow) {
  Stand stand(1);
  stand.offer(1);
  EXPECT_FALSE(stand.take_row());
  EXPECT_TRUE(stand.recorder().orders().push({RecordOrder::Kind::kEnd, 7, false}));
  stand.recorder().step();
  const auto row = stand.take_row();
  ASSERT_TRUE(row);
  EXPECT_TRUE(row->last);
  EXPECT_EQ(row->sets.size(), 1U);
}

TEST(Recorder, AStill_IsTheFirstSetWithAllHeadsAndItsRaymap) {
  Stand stand(2);
  stand.end();
  ASSERT_TRUE(stand.take_row()->last);
  stand.begin(true);
  stand.offer(1);
  stand.offer(2);
  stand.offer(3);
  const std::uint64_t set = stand.newest();
  stand.offer_raymap_of(set - 1);
  stand.offer(3);
  EXPECT_EQ(stand.take_row(), nullptr) << "its raymap is awaited";
  stand.offer_raymap_of(set);
  const auto row = stand.take_row();
  ASSERT_TRUE(row);
  EXPECT_TRUE(row->last);
  ASSERT_EQ(row->sets.size(), 1U);
  EXPECT_EQ(row->sets[0].number, set);
  ASSERT_EQ(row->raymaps.size(), 1U);
  EXPECT_EQ(row->raymaps[0].set, set);
  stand.offer(3);
  EXPECT_EQ(stand.take_row(), nullptr);
}

TEST(Recorder, AStillWithoutAHeadOrARaymap_EndsAfterItsTime) {
  Stand stand(2);
  stand.end();
  ASSERT_TRUE(stand.take_row()->last);
  stand.begin(true);
  int sets = 0;
  std::unique_ptr<TakeRow> row;
  for (; !row && sets < 1000; ++sets) {
    stand.offer(1);
    row = stand.take_row();
  }
  ASSERT_TRUE(row);
  EXPECT_NEAR(sets, 400, 5) << "2 s for the head, 2 s for the raymap, a set every 10 ms";
  ASSERT_EQ(row->sets.size(), 1U);
  EXPECT_EQ(row->sets[0].frames[1].placeholder, Placeholder::kMissing);
  EXPECT_TRUE(row->last);
}

TEST(Recorder, PicturesBecomeJpegsWhoseQualityFallsAsTheRingFills) {
  Stand stand(2, TakeMode::kJpeg);
  std::vector<std::unique_ptr<TakeRow>> rows;
  int last = 100;
  for (int k = 0; k < 20'000 && stand.recorder().counts().lost_sets.load() == 0; ++k) {
    stand.offer(3);
    if (auto row = stand.take_row()) rows.push_back(std::move(row));
    if (rows.size() == Recorder::kRows) break;
  }
  ASSERT_FALSE(rows.empty());
  EXPECT_EQ(rows.front()->streams[0]->format, PixelFormat::kMjpeg);
  EXPECT_EQ(rows.front()->sets[0].frames[0].quality, 90);
  for (const auto& row : rows) {
    for (const RecordedSet& set : row->sets) {
      EXPECT_LE(set.frames[0].quality, last);
      EXPECT_GE(set.frames[0].quality, 90 - 3 * Recorder::kQualityStep);
      last = set.frames[0].quality;
      EXPECT_EQ(set.frames[0].bytes[0], 0xff);
      EXPECT_EQ(set.frames[0].bytes[1], 0xd8);
    }
  }
}

}  // namespace
}  // namespace nodal::firmware
