// Raymaps whose neighbouring pixels do not hold neighbouring rays.
#include "stitch/table/sphere_order.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/table/table_compiler.h"
#include "tests/reference/double_blend.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"

namespace nodal::table {
namespace {

/// The rays of an equirectangular raymap in random order.
class Shuffled final : public geometry::RaymapLayout {
 public:
  Shuffled(int width, int height, std::mt19937& random)
      : RaymapLayout(width, height), sorted_(geometry::make_layout("equirectangular", width, height).value()) {
    from_.resize(static_cast<std::size_t>(width * height));
    std::iota(from_.begin(), from_.end(), 0);
    std::shuffle(from_.begin(), from_.end(), random);
  }
  std::string_view name() const override { return "shuffled"; }
  bool scattered() const override { return true; }
  std::optional<geometry::Ray> ray(double x, double y) const override {
    const int i = std::min(static_cast<int>(x), width() - 1);
    const int j = std::min(static_cast<int>(y), height() - 1);
    const int k = from_[static_cast<std::size_t>(j * width() + i)];
    return sorted_->ray(k % width() + 0.5, k / width() + 0.5);
  }
  double solid_angle(int, int) const override { return 4 * std::numbers::pi / (width() * height()); }
  std::optional<geometry::Pixel> pixel(const geometry::Ray&) const override { return std::nullopt; }

 private:
  std::unique_ptr<geometry::RaymapLayout> sorted_;
  std::vector<int> from_;
};

struct Shot {
  Calibration rig = test::cube_rig(64);
  std::vector<PixelFormat> formats;
  std::vector<test::Picture> pictures;
  std::vector<ImageView> heads;

  /// Waves of 30 samples, so that a table's errors are well below a level.
  Shot(PixelFormat format, std::mt19937& random) : formats(6, format) {
    for (HeadCalibration& head : rig.heads) {
      head.vignetting.coefficients = {-0.1, 0, 0};
      test::Picture& picture = pictures.emplace_back(format, 64, 64);
      const double phase = static_cast<double>(random() % 628) / 100;
      for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(format)); ++c) {
        const MutablePlaneView plane = picture.mutable_view().planes[c];
        for (int y = 0; y < plane.height; ++y) {
          for (int x = 0; x < plane.width; ++x) {
            plane.data[y * plane.row_stride + x * plane.pixel_stride] =
                static_cast<std::uint8_t>(120 + 30 * std::sin(0.2 * x + phase) * std::sin(0.15 * y));
          }
        }
      }
    }
    for (const test::Picture& picture : pictures) heads.push_back(picture.view());
  }
};

RC_GTEST_PROP(ScatteredRaymap, AnyOrder_IsWhatDoublePrecisionSaysPixelByPixel, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const PixelFormat format = std::array{PixelFormat::kGrey8, PixelFormat::kRgb24, PixelFormat::kI420}[random() % 3];
  const Shot shot(format, random);
  const Shuffled layout(static_cast<int>(20 + random() % 60), static_cast<int>(20 + random() % 40), random);
  TableOptions options;
  options.levels = 1;  // the reference has no pyramid levels
  const blend::BlendTable table = compile_blend_table(shot.rig, layout, format, shot.formats, options).value();
  const test::PreparedHeads prepared(table, shot.heads);
  const RaySampler sampler = RaySampler::make(shot.rig, layout, format, shot.formats, options).value();
  const std::vector<test::RealPlane> real = test::blend_in_double(sampler, shot.heads);
  // With every kernel, in rows of tiles.
  for (const blend::Kernel kernel : blend::kernels()) {
    test::Picture raymap(format, layout.width(), layout.height(), 77);
    for (int row = 0; row < layout.height();) {
      const int end = std::min(layout.height(), row + 2 * static_cast<int>(1 + random() % 9));
      blend::blend_rows_by(kernel, table, prepared.views(), blend::calibrated_tone(table), raymap.mutable_view(), row,
                           end);
      row = end;
    }
    for (std::size_t c = 0; c < real.size(); ++c) {
      const PlaneView plane = raymap.view().planes[c];
      for (int y = 0; y < plane.height; ++y) {
        for (int x = 0; x < plane.width; ++x) {
          const double expected = real[c].values[static_cast<std::size_t>(y * plane.width + x)];
          RC_ASSERT(std::abs(plane.data[y * plane.row_stride + x * plane.pixel_stride] - expected) <= 1.5);
        }
      }
    }
  }
}

TEST(ScatteredRaymap, HaltonInCellsOfOddSize_IsWhatDoublePrecisionSaysPixelByPixel) {
  std::mt19937 random(5);
  const Shot shot(PixelFormat::kI420, random);
  const auto layout = geometry::make_layout("halton", 1021, 515).value();
  TableOptions options;
  options.levels = 1;
  options.transition = Transition::kFeather;
  const blend::BlendTable table =
      compile_blend_table(shot.rig, *layout, PixelFormat::kI420, shot.formats, options).value();
  const test::PreparedHeads prepared(table, shot.heads);
  test::Picture raymap(PixelFormat::kI420, 1021, 515, 77);
  blend::blend_rows(table, prepared.views(), blend::calibrated_tone(table), raymap.mutable_view(), 0, 515);
  const RaySampler sampler = RaySampler::make(shot.rig, *layout, PixelFormat::kI420, shot.formats, options).value();
  const std::vector<test::RealPlane> real = test::blend_in_double(sampler, shot.heads);
  double worst = 0;
  for (std::size_t c = 0; c < real.size(); ++c) {
    const PlaneView plane = raymap.view().planes[c];
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        const double expected = real[c].values[static_cast<std::size_t>(y * plane.width + x)];
        worst = std::max(worst, std::abs(plane.data[y * plane.row_stride + x * plane.pixel_stride] - expected));
      }
    }
  }
  EXPECT_LE(worst, 1.5);
}

TEST(ScatteredRaymap, HeadThatIsMissing_LeavesAsMuchOfEveryRayAsInAPicture) {
  std::mt19937 random(3);
  const Shot shot(PixelFormat::kGrey8, random);
  const Shuffled layout(64, 32, random);
  TableOptions options;
  options.transition = Transition::kFeather;  // a cover's share is not the sampler's
  const blend::BlendTable table =
      compile_blend_table(shot.rig, layout, PixelFormat::kGrey8, shot.formats, options).value();
  std::vector<ImageView> heads = shot.heads;
  heads[2].planes[0].data = nullptr;
  std::vector<std::uint8_t> validity(64 * 32, 1);
  blend::validity_rows(table, heads, {validity.data(), 64, 32, 64, 1}, 0, 32);
  const RaySampler sampler = RaySampler::make(shot.rig, layout, PixelFormat::kGrey8, shot.formats, options).value();
  RowSampler row(sampler);
  for (int y = 0; y < 32; ++y) {
    row.sample(0, y);
    for (int x = 0; x < 64; ++x) {
      double weight = 0;
      for (const RaySample& s : row.at(x)) weight += s.head == 2 ? 0 : s.weight;
      EXPECT_NEAR(validity[static_cast<std::size_t>(y * 64 + x)], 255 * weight, 3) << x << ", " << y;
    }
  }
}

/// Tiles whose rays are farther apart than in a square of so many evenly spread rays, with a margin for their
/// positions.
int wide_tiles(const geometry::RaymapLayout& layout, const std::vector<std::uint32_t>& places) {
  const double side = 8 * std::sqrt(4 * std::numbers::pi / (layout.width() * layout.height()));
  int wide = 0;
  for (std::size_t tile = 0; tile < places.size() / 64; ++tile) {
    std::array<geometry::Ray, 64> rays;
    for (std::size_t p = 0; p < 64; ++p) {
      const std::uint32_t place = places[tile * 64 + p];
      rays[p] = layout.ray(place & 0xffff, place >> 16).value();
    }
    double widest = 0;
    for (std::size_t p = 0; p < 64; ++p) {
      for (std::size_t q = 0; q < p; ++q) {
        widest = std::max(widest, (rays[p].direction() - rays[q].direction()).norm());
      }
    }
    wide += widest > 1.4 * std::sqrt(2.0) * side ? 1 : 0;
  }
  return wide;
}

std::vector<std::uint32_t> order_of(const geometry::RaymapLayout& layout) {
  const Calibration rig = test::cube_rig(24);
  const std::vector<PixelFormat> formats(6, PixelFormat::kGrey8);
  return sphere_order(RaySampler::make(rig, layout, PixelFormat::kGrey8, formats, {}).value(), 0).places;
}

/// The most cache lines of 64 pixels that are written to, but not complete, at one time.
std::size_t most_incomplete_lines(const geometry::RaymapLayout& layout, const std::vector<std::uint32_t>& places) {
  std::vector<int> written(static_cast<std::size_t>(layout.width() * layout.height() / 64));
  std::size_t incomplete = 0, most = 0;
  for (const std::uint32_t place : places) {
    const std::size_t line = ((place >> 16) * static_cast<std::size_t>(layout.width()) + (place & 0xffff)) / 64;
    if (++written[line] == 1) most = std::max(most, ++incomplete);
    if (written[line] == 64) --incomplete;
  }
  EXPECT_EQ(incomplete, 0U);
  return most;
}

TEST(SphereOrder, RaysSpreadEvenly_AreSideBySideInTheirTiles) {
  // A Fibonacci spiral in random order; each ray represents an area of 4 pi / n.
  class Spiral final : public geometry::RaymapLayout {
   public:
    Spiral() : RaymapLayout(128, 64) {}
    std::string_view name() const override { return "spiral"; }
    bool scattered() const override { return true; }
    std::optional<geometry::Ray> ray(double x, double y) const override {
      const int k = (static_cast<int>(y) * 128 + static_cast<int>(x)) * 4099 % 8192;
      const double down = (2.0 * k + 1) / 8192 - 1;
      const double theta = 2.399963229728653 * k;
      const double level = std::sqrt(1 - down * down);
      return geometry::Ray::towards(level * std::sin(theta), down, level * std::cos(theta));
    }
    double solid_angle(int, int) const override { return 4 * std::numbers::pi / 8192; }
    std::optional<geometry::Pixel> pixel(const geometry::Ray&) const override { return std::nullopt; }
  };
  const Spiral layout;
  const std::vector<std::uint32_t> places = order_of(layout);
  ASSERT_EQ(places.size(), 8192U);
  EXPECT_LE(wide_tiles(layout, places), 14);  // around the poles, and where one strip ends and the next begins
  std::vector<std::uint32_t> all(places);
  std::ranges::sort(all);
  EXPECT_EQ(std::ranges::adjacent_find(all), all.end());
}

TEST(SphereOrder, LayoutWithARegularOrder_CompletesLinesSoonAndKeepsItsTilesSmall) {
  const auto layout = geometry::make_layout("halton", 1024, 512).value();
  const std::uint64_t period = layout->cells(1024, 8).count;
  ASSERT_EQ(period, 432U);
  const std::vector<std::uint32_t> places = order_of(*layout);
  // Every cell is in lines of its own, and 64 pixels that follow each other are in up to two lines.
  EXPECT_LE(most_incomplete_lines(*layout, places), 2 * (1024 * 512 / period + 1));
  // One of the 8192 tiles for each cell may be in two cells; near the poles some are elongated.
  EXPECT_LE(wide_tiles(*layout, places), 720);
  std::vector<std::uint32_t> all(places);
  std::ranges::sort(all);
  EXPECT_EQ(std::ranges::adjacent_find(all), all.end());
  EXPECT_EQ(all.size(), 1024U * 512U);
  EXPECT_NE(all.back(), blend::GridTable::kNowhere);
}

TEST(SphereOrder, SmallRaymapWithARegularOrder_IsInStrips) {
  const auto layout = geometry::make_layout("halton", 512, 256).value();
  EXPECT_GT(layout->cells(1024, 8).count, 0U);
  EXPECT_LE(wide_tiles(*layout, order_of(*layout)), 35);  // 2048 tiles; cells would have more wide ones
}

}  // namespace
}  // namespace nodal::table
