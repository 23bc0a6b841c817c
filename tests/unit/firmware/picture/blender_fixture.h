// A blender, the pictures of four heads and their calibration.
#pragma once

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "firmware/picture/blender.h"
#include "hal/sim/clock.h"
#include "stitch/blend/blend.h"
#include "stitch/table/table_compiler.h"
#include "tests/reference/prepared_heads.h"
#include "tests/support/rigs.h"

namespace nodal::firmware {

inline constexpr int kHeads = 4;
inline constexpr int kSide = 48;

inline RaymapConfig raymap_config() {
  RaymapConfig config;
  config.width = 200;
  config.height = 100;  // one whole band and a partial one
  config.format = PixelFormat::kRgb24;
  return config;
}

inline sets::BlendSetup installed(const std::string& name, std::uint8_t mark,
                                  const std::vector<PixelFormat>& delivered = {}) {
  Calibration calibration = test::ring(kHeads, kSide, kSide);
  calibration.name = name;
  const std::vector<PixelFormat> formats(kHeads, PixelFormat::kRgb24);
  const RaymapConfig config = raymap_config();
  const table::RaymapSpec spec{"equirectangular", config.width, config.height, config.format};
  auto table = table::compile_blend_table(calibration, spec, formats);
  EXPECT_TRUE(table);
  Sha256 id{};
  id.fill(mark);
  std::vector<blend::BlendTable> tables;
  tables.push_back(std::move(*table));
  return sets::with_memory(sets::make_plan(id, name, std::move(tables), {}, {}, delivered));
}

class BlenderTest : public testing::Test {
 protected:
  BlenderTest() {
    for (std::size_t i = 0; i < kHeads; ++i) {
      pictures[i].resize(kSide * kSide * 3);
      for (std::uint8_t& value : pictures[i]) {
        value = static_cast<std::uint8_t>((random_ = random_ * 1664525 + 1013904223) >> 24);
      }
    }
  }
  FrameSet full_set(std::uint64_t number) {
    FrameSet set;
    set.number = number;
    for (std::size_t i = 0; i < kHeads; ++i) {
      set.mask |= head_bit(i);
      set.frames[i].image = packed_image(PixelFormat::kRgb24, kSide, kSide, std::as_const(pictures[i]).data());
    }
    return set;
  }
  /// The result of blend_rows for the set in one call; the bands must give exactly the same.
  LineVector whole(const FrameSet& set, const sets::BlendPlan& calibration) {
    const RaymapConfig config = raymap_config();
    LineVector pixels(packed_size(config.format, config.width, config.height));
    std::array<ImageView, kHeads> views;
    for (std::size_t i = 0; i < kHeads; ++i) {
      if (set.has(i)) views[i] = set.frames[i].image;
    }
    blend::blend_rows(calibration.tables[0], test::PreparedHeads(calibration.tables[0], views).views(),
                      calibration.tone, packed_image(config.format, config.width, config.height, pixels.data()), 0,
                      config.height);
    return pixels;
  }
  void lend(const FrameSet& set) {
    const SetLoan loan = sets.take();
    ASSERT_TRUE(loan);
    loan.edit() = set;
    sets_in.offer(loan);
  }
  void blend(const FrameSet& set) {
    lend(set);
    while (blender.step()) {}
  }
  /// The number of sets that the blender still holds.
  std::size_t held() {
    sets.collect();
    return sets.lent();
  }
  void install(sets::BlendSetup calibration) { ASSERT_TRUE(blender.swap().tables_in().push(std::move(calibration))); }

  std::array<std::vector<std::uint8_t>, kHeads> pictures;
  hal::sim::SimClock clock;
  LoanPool<FrameSet> sets{6};
  Outlet<SetLoan> sets_in{Blender::kSets, true};
  Blender blender{raymap_config(), clock, sets_in};

 private:
  std::uint32_t random_ = 1;
};

}  // namespace nodal::firmware
