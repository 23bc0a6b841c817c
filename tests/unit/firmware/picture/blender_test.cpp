#include <gtest/gtest.h>

#include <thread>
#include <utility>
#include <vector>

#include "blender_fixture.h"

namespace nodal::firmware {
namespace {

TEST_F(BlenderTest, WithoutACalibration_SetsGoBackAndAreCounted) {
  FrameSet set = full_set(0);
  blend(set);
  EXPECT_EQ(held(), 0u);
  EXPECT_EQ(blender.counts().without_calibration.load(), 1u);
  EXPECT_FALSE(blender.raymaps_out().pop());
  EXPECT_TRUE(blender.idle());
}

TEST_F(BlenderTest, ASetInBands_IsTheRaymapInOnePiece) {
  const sets::BlendSetup calibration = installed("one", 1);
  install(calibration);
  FrameSet set = full_set(7);
  set.sync.trigger = 9;
  blend(set);
  EXPECT_EQ(held(), 0u);
  const auto raymap = blender.raymaps_out().pop();
  ASSERT_TRUE(raymap);
  EXPECT_EQ(*raymap->pixels, whole(set, *calibration.plan));
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(raymap->pixels->data()) % 64, 0U) << "they begin with a cache line";
  EXPECT_EQ(raymap->info.set, 7u);
  EXPECT_EQ(raymap->info.sync.trigger, 9u);
  EXPECT_EQ(raymap->info.heads, 0b1111u);
  EXPECT_EQ(raymap->info.calibration, calibration.plan->id);
}

TEST_F(BlenderTest, AHeadIsMissing_ItsBitIsTooAndTheOthersTakeItsRays) {
  const sets::BlendSetup calibration = installed("one", 1);
  install(calibration);
  FrameSet set = full_set(0);
  set.mask &= ~head_bit(2);
  blend(set);
  const auto raymap = blender.raymaps_out().pop();
  ASSERT_TRUE(raymap);
  EXPECT_EQ(raymap->info.heads, 0b1011u);
  EXPECT_EQ(*raymap->pixels, whole(set, *calibration.plan));
}

TEST_F(BlenderTest, AFrameOfAnotherSize_IsNotReadAndCounted) {
  const sets::BlendSetup calibration = installed("one", 1);
  install(calibration);
  FrameSet set = full_set(0);
  set.frames[1].image = packed_image(PixelFormat::kRgb24, kSide / 2, kSide, std::as_const(pictures[1]).data());
  blend(set);
  const auto raymap = blender.raymaps_out().pop();
  ASSERT_TRUE(raymap);
  EXPECT_EQ(raymap->info.heads, 0b1101u);
  EXPECT_EQ(blender.counts().unfit_frames.load(), 1u);
  FrameSet without = full_set(0);
  without.mask &= ~head_bit(1);
  EXPECT_EQ(*raymap->pixels, whole(without, *calibration.plan));
}

TEST_F(BlenderTest, ANewCalibration_IsAdoptedBetweenSetsAndTheOldOneHandedOut) {
  const sets::BlendSetup first = installed("one", 1);
  const sets::BlendSetup second = installed("two", 2);
  install(first);
  FrameSet set = full_set(0);
  lend(set);
  ASSERT_TRUE(blender.step());  // takes the first calibration and begins a raymap
  install(second);              // while the raymap is being blended
  while (blender.step()) {}
  EXPECT_EQ(blender.raymaps_out().pop()->info.calibration, first.plan->id);
  EXPECT_EQ(blender.swap().tables_out().pop()->plan, first.plan);
  EXPECT_EQ(blender.counts().adopted.load(), 2u);
  FrameSet next = full_set(1);
  blend(next);
  EXPECT_EQ(blender.raymaps_out().pop()->info.calibration, second.plan->id);
  EXPECT_EQ(blender.sets_begun(), 2u);
  for (std::uint64_t from = 0; from < 2; ++from) {
    const auto adoption = blender.swap().adoptions_out().pop();
    ASSERT_TRUE(adoption);
    EXPECT_EQ(adoption->first_set, from);
    EXPECT_EQ(adoption->calibration, from == 0 ? first.plan->id : second.plan->id);
  }
}

TEST_F(BlenderTest, NobodyTakesTheRaymaps_ItWaitsAndLosesNone) {
  install(installed("one", 1));
  for (std::uint64_t i = 0; i <= Blender::kRaymapsWaiting; ++i) blend(full_set(i));
  EXPECT_FALSE(blender.idle());
  EXPECT_EQ(blender.counts().blended.load(), Blender::kRaymapsWaiting);
  for (std::uint64_t i = 0; i <= Blender::kRaymapsWaiting; ++i) {
    const auto raymap = blender.raymaps_out().pop();
    ASSERT_TRUE(raymap);
    EXPECT_EQ(raymap->info.set, i);
    while (blender.step()) {}
  }
  EXPECT_TRUE(blender.idle());
}

/// The ring's heads interlaced, the bottom field first.
sets::BlendSetup installed_by_field() {
  const RaymapConfig config = raymap_config();
  const std::vector<PixelFormat> formats(kHeads, PixelFormat::kRgb24);
  std::vector<blend::BlendTable> tables;
  for (const FieldParity parity : {FieldParity::kBottom, FieldParity::kTop}) {
    table::TableOptions options;
    options.field = parity;
    const table::RaymapSpec spec{"equirectangular", config.width, config.height, config.format};
    tables.push_back(table::compile_blend_table(test::ring(kHeads, kSide, kSide), spec, formats, options).value());
  }
  return sets::with_memory(sets::make_plan({}, "fields", std::move(tables)));
}

TEST_F(BlenderTest, ATableAField_EachFieldIsBlendedAsIfItsRowsWereAPictureOfTheirOwn) {
  const sets::BlendSetup calibration = installed_by_field();
  install(calibration);
  FrameSet set = full_set(3);
  set.mid_exposure = Instant{} + Duration::milliseconds(100);
  set.second_field = Duration::milliseconds(20);
  for (std::size_t i = 0; i < kHeads; ++i) set.frames[i].fields = Fields::kBottomFirst;
  blend(set);
  EXPECT_EQ(held(), 0u);
  EXPECT_EQ(blender.counts().blended.load(), 2u);
  for (int number = 0; number < 2; ++number) {
    const auto raymap = blender.raymaps_out().pop();
    ASSERT_TRUE(raymap);
    EXPECT_EQ(raymap->info.set, 3u);
    ASSERT_TRUE(raymap->info.field);
    EXPECT_EQ(raymap->info.field->number, number);
    EXPECT_EQ(raymap->info.field->parity, number == 0 ? FieldParity::kBottom : FieldParity::kTop);
    EXPECT_EQ(raymap->info.mid_exposure, Instant{} + Duration::milliseconds(100 + 20 * number));
    // The field's rows, copied out by hand.
    constexpr std::size_t kRow = kSide * 3;
    std::array<std::vector<std::uint8_t>, kHeads> rows;
    std::array<ImageView, kHeads> views;
    for (std::size_t i = 0; i < kHeads; ++i) {
      for (std::size_t y = number == 0 ? 1 : 0; y < kSide; y += 2) {
        const auto from = pictures[i].begin() + static_cast<std::ptrdiff_t>(y * kRow);
        rows[i].insert(rows[i].end(), from, from + kRow);
      }
      views[i] = packed_image(PixelFormat::kRgb24, kSide, kSide / 2, std::as_const(rows[i]).data());
    }
    const blend::BlendTable& table = calibration.plan->tables[static_cast<std::size_t>(number)];
    LineVector expected(packed_size(table.format, table.width, table.height));
    blend::blend_rows(table, test::PreparedHeads(table, views).views(), calibration.plan->tone,
                      packed_image(table.format, table.width, table.height, expected.data()), 0, table.height);
    EXPECT_EQ(*raymap->pixels, expected) << "field " << number;
  }
}

TEST_F(BlenderTest, ATableAFieldAndFramesOfAnotherOrder_AreNotReadAndCountedOnce) {
  install(installed_by_field());
  FrameSet set = full_set(0);
  for (std::size_t i = 0; i < kHeads; ++i) set.frames[i].fields = Fields::kBottomFirst;
  set.frames[1].fields = Fields::kTopFirst;
  set.frames[2].fields = Fields::kProgressive;
  blend(set);
  EXPECT_EQ(blender.raymaps_out().pop()->info.heads, 0b1001u);
  EXPECT_EQ(blender.raymaps_out().pop()->info.heads, 0b1001u);
  EXPECT_EQ(blender.counts().unfit_frames.load(), 2u);
}

TEST_F(BlenderTest, ATableAFieldAndOneBufferLeft_CostsTheWholeSet) {
  install(installed_by_field());
  std::vector<Raymap> kept;
  for (std::uint64_t i = 0; i < Blender::kMaxBuffers; ++i) {
    FrameSet set = full_set(i);
    for (std::size_t h = 0; h < kHeads; ++h) set.frames[h].fields = Fields::kBottomFirst;
    blend(set);
    while (auto raymap = blender.raymaps_out().pop()) kept.push_back(std::move(*raymap));
    if (i == 0 || i == Blender::kMaxBuffers / 2) {  // one of two, so that an odd one is left for the other
      kept[i == 0 ? 0 : 1].pixels = {};
    }
  }
  EXPECT_EQ(kept.size(), Blender::kMaxBuffers + 2);
  EXPECT_EQ(blender.counts().without_buffer.load(), Blender::kMaxBuffers / 2 - 1);
  for (std::size_t i = 0; i < kept.size(); ++i) EXPECT_EQ(kept[i].info.field->number, static_cast<int>(i % 2));
}

TEST_F(BlenderTest, BuffersThatComeBack_AreUsedAgain) {
  install(installed("one", 1));
  const std::uint8_t* first = nullptr;
  for (std::uint64_t i = 0; i < 10; ++i) {
    FrameSet set = full_set(i);
    blend(set);
    auto raymap = blender.raymaps_out().pop();
    ASSERT_TRUE(raymap);
    if (!first) first = raymap->pixels->data();
    EXPECT_EQ(raymap->pixels->data(), first);
  }
}

TEST_F(BlenderTest, BuffersThatNeverComeBack_CostRaymapsAndNotMemory) {
  install(installed("one", 1));
  std::vector<Raymap> kept;
  for (std::uint64_t i = 0; i < 2 * Blender::kMaxBuffers; ++i) {
    FrameSet set = full_set(i);
    blend(set);
    if (auto raymap = blender.raymaps_out().pop()) kept.push_back(std::move(*raymap));
  }
  EXPECT_EQ(kept.size(), Blender::kMaxBuffers);
  EXPECT_EQ(blender.counts().without_buffer.load(), Blender::kMaxBuffers);
}

TEST_F(BlenderTest, FourThreadsAtOnce_GiveTheSameBytesAndLoseNoSet) {
  const std::array<sets::BlendSetup, 2> calibrations = {installed("one", 1), installed("two", 2)};
  install(calibrations[0]);
  // Each of two rounds, heads prepared and bands blended: what one leaves behind harms the next.
  constexpr std::uint64_t kSets = 1000;
  std::vector<FrameSet> filled;
  for (std::uint64_t i = 0; i < 6; ++i) {
    filled.push_back(full_set(i));
    filled.back().mask &= ~(i == 0 ? 0U : head_bit(i % kHeads));
  }
  std::vector<LineVector> expected;
  for (const FrameSet& set : filled) expected.push_back(whole(set, *calibrations[0].plan));

  std::atomic<bool> stop{false};
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      while (!stop.load()) {
        if (!blender.step()) std::this_thread::yield();
      }
    });
  }
  // This thread acts as capture, encoder and keeper.
  std::uint64_t given = 0;
  std::uint64_t got = 0;
  while (got < kSets) {
    if (given < kSets && !sets_in.full()) lend(filled[given++ % filled.size()]);
    while (blender.swap().tables_out().pop()) {}
    while (blender.swap().adoptions_out().pop()) {}
    if (given % 50 == 49) {
      sets::BlendSetup next = calibrations[(given / 50) % 2];
      (void)blender.swap().tables_in().push(std::move(next));  // both tables give the same picture
    }
    auto raymap = blender.raymaps_out().pop();
    if (!raymap) {
      std::this_thread::yield();
      continue;
    }
    ++got;
    ASSERT_EQ(*raymap->pixels, expected[raymap->info.set]) << "raymap " << got;
  }
  stop.store(true);
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(blender.counts().blended.load(), kSets);
}

}  // namespace
}  // namespace nodal::firmware
