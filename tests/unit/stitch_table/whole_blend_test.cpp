// From calibration to pixels: the compiled table and the integer blend together.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/table_compiler.h"
#include "tests/reference/double_blend.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"
#include "tests/reference/score.h"

namespace nodal::test {
namespace {

/// A raymap format with head formats that can be blended into it.
struct Formats {
  PixelFormat raymap;
  std::vector<PixelFormat> heads;
};

Formats random_formats(std::mt19937& random, std::size_t heads) {
  constexpr std::array kYuv{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy};
  Formats formats{std::array{PixelFormat::kGrey8, PixelFormat::kRgb24, PixelFormat::kI420}[random() % 3], {}};
  for (std::size_t h = 0; h < heads; ++h) {
    formats.heads.push_back(formats.raymap == PixelFormat::kI420 ? kYuv[random() % 4] : formats.raymap);
  }
  return formats;
}

struct Heads {
  std::vector<Picture> pictures;
  std::vector<ImageView> views;

  template <class Fill>
  Heads(const Calibration& rig, const std::vector<PixelFormat>& formats, Fill fill) {
    for (std::size_t h = 0; h < rig.heads.size(); ++h) {
      pictures.emplace_back(formats[h], rig.heads[h].width, rig.heads[h].height);
      for (std::uint8_t& byte : pictures.back().bytes) byte = fill();
    }
    for (const Picture& picture : pictures) views.push_back(picture.view());
  }
};

Picture blended(const blend::BlendTable& table, const std::vector<ImageView>& heads) {
  Picture raymap(table.format, table.width, table.height, 77);
  blend::blend_rows(table, PreparedHeads(table, heads).views(), blend::calibrated_tone(table), raymap.mutable_view(), 0,
                    table.height);
  return raymap;
}

RC_GTEST_PROP(WholeBlend, ConstantScene_IsExactlyThatConstantWhereAHeadLooksAndBlackElsewhere,
              (std::uint32_t seed, std::uint8_t level)) {
  std::mt19937 random(seed);
  const Calibration rig = random_rig(random);
  const Formats formats = random_formats(random, rig.heads.size());
  const auto layout = geometry::make_layout("equirectangular", 38, 19).value();
  const auto table = table::compile_blend_table(rig, *layout, formats.raymap, formats.heads);
  RC_PRE(table.has_value());
  const Picture raymap = blended(*table, Heads(rig, formats.heads, [&] { return level; }).views);
  const std::vector<geometry::Head> heads = geometry::make_heads(rig).value();
  for (int c = 0; c < component_count(formats.raymap); ++c) {
    const PlaneView plane = raymap.view().planes[static_cast<std::size_t>(c)];
    const PlaneGrid plane_grid = component_grid(formats.raymap, c);
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        const geometry::Ray ray =
            layout->ray(std::min(38.0, (x + 0.5) * plane_grid.step_x), std::min(19.0, (y + 0.5) * plane_grid.step_y))
                .value();
        bool seen = false;
        bool on_an_edge = false;
        for (const geometry::Head& head : heads) {
          const std::optional<geometry::Pixel> pixel = head.project(ray);
          if (!pixel) continue;
          seen |= head.contains(*pixel);
          on_an_edge |= std::abs(head.distance_to_edge(*pixel)) < 2e-6;
        }
        const int got = plane.data[y * plane.row_stride + x * plane.pixel_stride];
        const int black = formats.raymap == PixelFormat::kI420 && c > 0 ? 128 : 0;
        RC_ASSERT(got == (seen ? level : black) || on_an_edge);
      }
    }
  }
}

/// Waves of 60 levels with at most 6 levels between samples: the table's errors, 1/32 of a sample and 1.5/256 of a
/// weight, are then well below a level.
Heads waves(const Calibration& rig, const std::vector<PixelFormat>& formats, std::mt19937& random) {
  Heads heads(rig, formats, [] { return std::uint8_t{0}; });
  for (Picture& picture : heads.pictures) {
    const MutableImageView view = picture.mutable_view();
    for (int c = 0; c < component_count(picture.format); ++c) {
      const MutablePlaneView& plane = view.planes[static_cast<std::size_t>(c)];
      const double phase = static_cast<double>(random() % 628) / 100;
      const double turn = static_cast<double>(random() % 628) / 100;
      for (int y = 0; y < plane.height; ++y) {
        for (int x = 0; x < plane.width; ++x) {
          const double level = 128 + 30 * std::sin(0.2 * (x * std::cos(turn) + y * std::sin(turn)) + phase);
          plane.data[y * plane.row_stride + x * plane.pixel_stride] = static_cast<std::uint8_t>(level);
        }
      }
    }
  }
  return heads;
}

RC_GTEST_PROP(WholeBlend, AnyRig_IsWithinOneLevelOfDoublePrecision, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const Calibration rig = random_rig_with_light(random);
  const Formats formats = random_formats(random, rig.heads.size());
  const auto layout = geometry::make_layout("equirectangular", 40, 20).value();
  table::TableOptions options;
  options.sharpen = static_cast<int>(random() % 4);
  options.levels = 1;  // the double-precision blend has no pyramid levels
  const auto table = table::compile_blend_table(rig, *layout, formats.raymap, formats.heads, options);
  RC_PRE(table.has_value());
  const Heads heads = waves(rig, formats.heads, random);
  const auto sampler = table::RaySampler::make(rig, *layout, formats.raymap, formats.heads, options).value();
  const std::vector<RealPlane> real = blend_in_double(sampler, heads.views);
  const std::vector<std::uint8_t> rounded = round_to_levels(formats.raymap, 40, 20, real);
  RC_ASSERT(difference(blended(*table, heads.views).bytes, rounded).largest <= 1);
}

TEST(WholeBlend, MinifiedCheckerboard_IsItsMeanInsteadOfItsAliases) {
  const Calibration rig = cube_rig(512);  // 256 x 128 has one sample per 3.1 picture samples, in each direction
  const std::vector<PixelFormat> formats(6, PixelFormat::kGrey8);
  const table::RaymapSpec spec{"equirectangular", 256, 128, PixelFormat::kGrey8};
  int at = -1;
  const Heads heads(rig, formats, [&] {
    ++at;
    return static_cast<std::uint8_t>((at % 512 + at / 512) % 2 == 0 ? 40 : 200);
  });
  const auto spread = [&](int levels) {
    table::TableOptions options;
    options.levels = levels;
    options.sharpen = 0;
    const Picture raymap = blended(table::compile_blend_table(rig, spec, formats, options).value(), heads.views);
    int least = 255, most = 0;
    for (int x = 0; x < 256; ++x) {  // the middle row; near the poles nothing is minified sideways
      const int level = raymap.bytes[static_cast<std::size_t>(64 * 256 + x)];
      least = std::min(least, level);
      most = std::max(most, level);
    }
    return most - least;
  };
  EXPECT_EQ(spread(5), 0);
  EXPECT_GT(spread(1), 100);
}

TEST(WholeBlend, QuarterTurnOfTheRig_ShiftsTheRaymapByAQuarterOfItsWidth) {
  std::mt19937 random(9);
  const Calibration rig = random_rig(random);
  Calibration turned = rig;
  // The rig rotated by a quarter turn to the right: the old ray (x, y, z) is now (z, y, -x).
  const Eigen::Matrix3d R_new_old = (Eigen::Matrix3d() << 0, 0, 1, 0, 1, 0, -1, 0, 0).finished();
  for (HeadCalibration& head : turned.heads) {
    head.R_head_rig = geometry::rows_of(geometry::matrix_of(head.R_head_rig) * R_new_old.transpose());
  }
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kRgb24);
  const table::RaymapSpec spec{"equirectangular", 256, 128, PixelFormat::kRgb24};
  const Heads heads(rig, formats, [&] { return static_cast<std::uint8_t>(random()); });
  const Picture before = blended(table::compile_blend_table(rig, spec, formats).value(), heads.views);
  const Picture after = blended(table::compile_blend_table(turned, spec, formats).value(), heads.views);
  std::vector<std::uint8_t> shifted;
  for (int y = 0; y < 128; ++y) {
    const auto row = after.bytes.begin() + y * 3 * 256;
    shifted.insert(shifted.end(), row + 3 * 64, row + 3 * 256);
    shifted.insert(shifted.end(), row, row + 3 * 64);
  }
  const Difference off = difference(before.bytes, shifted);
  // 64 columns are whole tiles. Only sines of angles a quarter turn apart differ in their last bit, which hardly ever
  // changes a quantized value of the table or a tile's content.
  EXPECT_LE(off.differing, 64U * 3);
}

class HeadLost : public testing::TestWithParam<Transition> {};

TEST_P(HeadLost, OthersFillInWhereTheySeeAndOnlyTheRestGoesBlack) {
  const Calibration rig = cube_rig(64);
  const std::vector<PixelFormat> formats(6, PixelFormat::kGrey8);
  const table::RaymapSpec spec{"equirectangular", 128, 64, PixelFormat::kGrey8};
  table::TableOptions options;
  options.transition = GetParam();
  options.seam_width_deg = 10;
  const auto table = table::compile_blend_table(rig, spec, formats, options).value();
  Heads heads(rig, formats, [] { return std::uint8_t{90}; });
  heads.views[0] = {};
  const Picture raymap = blended(table, heads.views);
  Picture validity(PixelFormat::kGrey8, 128, 64);
  blend::validity_rows(table, heads.views, validity.mutable_view().planes[0], 0, 64);
  const std::vector<geometry::Head> made = geometry::make_heads(rig).value();
  int black = 0;
  int filled = 0;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 128; ++x) {
      const auto i = static_cast<std::size_t>(y * 128 + x);
      const double yaw = (x + 0.5) / 128 * 2 * std::numbers::pi - std::numbers::pi;
      const double pitch = std::numbers::pi / 2 - (y + 0.5) / 64 * std::numbers::pi;
      const auto ray =
          geometry::Ray::towards({std::cos(pitch) * std::sin(yaw), -std::sin(pitch), std::cos(pitch) * std::cos(yaw)});
      const auto inside = [&](std::size_t h, double margin) {  // px from the edges of the head's picture
        const auto at = made[h].project(ray);
        return at && made[h].distance_to_edge(*at) > margin;
      };
      bool seen = false, well_seen = false;
      for (std::size_t h = 1; h < 6; ++h) {
        seen = seen || inside(h, -0.5);
        well_seen = well_seen || inside(h, 2);  // else its weight may be less than one that a table keeps
      }
      EXPECT_EQ(raymap.bytes[i], validity.bytes[i] == 0 ? 0 : 90) << x << ", " << y;
      if (well_seen) {
        EXPECT_GT(validity.bytes[i], 0) << x << ", " << y;
      } else if (!seen) {
        EXPECT_EQ(validity.bytes[i], 0) << x << ", " << y;
      }
      black += seen ? 0 : 1;
      filled += well_seen && inside(0, 2) ? 1 : 0;
    }
  }
  EXPECT_GT(black, 500);
  EXPECT_GT(filled, 300);
}

TEST_P(HeadLost, PixelsThatDidNotShowIt_StayAsTheyWere) {
  const Calibration rig = cube_rig(64);
  const std::vector<PixelFormat> formats(6, PixelFormat::kGrey8);
  const table::RaymapSpec spec{"equirectangular", 128, 64, PixelFormat::kGrey8};
  table::TableOptions options;
  options.transition = GetParam();
  const auto table = table::compile_blend_table(rig, spec, formats, options).value();
  std::mt19937 random(4);
  Heads heads(rig, formats, [&] { return static_cast<std::uint8_t>(random()); });
  const Picture before = blended(table, heads.views);
  heads.views[0] = {};
  const Picture after = blended(table, heads.views);
  Picture validity(PixelFormat::kGrey8, 128, 64);
  // The head's share of a pixel, without any other to replace it.
  std::vector<ImageView> alone(6);
  alone[0] = before.view();
  blend::BlendTable bare = table;
  bare.cover.clear();
  blend::validity_rows(bare, alone, validity.mutable_view().planes[0], 0, 64);
  int same = 0;
  for (std::size_t i = 0; i < before.bytes.size(); ++i) {
    if (validity.bytes[i] != 0) continue;
    EXPECT_EQ(after.bytes[i], before.bytes[i]);
    ++same;
  }
  EXPECT_GT(same, 4000);
}

INSTANTIATE_TEST_SUITE_P(WholeBlend, HeadLost, testing::Values(Transition::kSeam, Transition::kFeather));

}  // namespace
}  // namespace nodal::test
