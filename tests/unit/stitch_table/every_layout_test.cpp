// Every raymap layout, compiled and blended in integers, beside the blend in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/raymap/ray_list.h"
#include "stitch/table/table_compiler.h"
#include "tests/reference/double_blend.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"
#include "tests/reference/score.h"

namespace nodal::test {
namespace {

/// Six heads that cover the sphere, with waves of at most 6 levels between samples: the table's errors, 1/32 of a
/// sample and 1.5/256 of a weight, are then well below a level.
struct Waves {
  Calibration rig = cube_rig(64);
  std::vector<PixelFormat> formats;
  std::vector<Picture> pictures;
  std::vector<ImageView> views;

  explicit Waves(PixelFormat format) : formats(6, format) {
    for (std::size_t h = 0; h < rig.heads.size(); ++h) {
      Picture& picture = pictures.emplace_back(format, 64, 64);
      const MutableImageView view = picture.mutable_view();
      for (int c = 0; c < component_count(format); ++c) {
        const MutablePlaneView& plane = view.planes[static_cast<std::size_t>(c)];
        const double turn = 0.7 * static_cast<double>(h) + c;
        for (int y = 0; y < plane.height; ++y) {
          for (int x = 0; x < plane.width; ++x) {
            const double level = 128 + 30 * std::sin(0.2 * (x * std::cos(turn) + y * std::sin(turn)));
            plane.data[y * plane.row_stride + x * plane.pixel_stride] = static_cast<std::uint8_t>(level);
          }
        }
      }
    }
    for (const Picture& picture : pictures) views.push_back(picture.view());
  }
};

/// Rays in an order that has nothing to do with the sphere's: every 37th of a spiral from the zenith to the nadir.
std::string spiral() {
  constexpr int kWidth = 40, kHeight = 26, kRays = kWidth * kHeight;
  std::string text = "rays " + std::to_string(kWidth) + " " + std::to_string(kHeight) + "\n";
  for (int k = 0; k < kRays; ++k) {
    const int n = 37 * k % kRays;
    const double y = 2 * (n + 0.5) / kRays - 1, theta = 2.399963229728653 * n, across = std::sqrt(1 - y * y);
    text += std::to_string(across * std::sin(theta)) + " " + std::to_string(y) + " " +
            std::to_string(across * std::cos(theta)) + "\n";
  }
  return text;
}

class EveryLayoutBlended : public testing::TestWithParam<PixelFormat> {};

TEST_P(EveryLayoutBlended, IsWithinOneLevelOfDoublePrecision_AndBlackWithoutARay) {
  const Waves heads(GetParam());
  std::vector<std::string> texts{"cube:pad=3", "equiangular_cube:pad=2", "central_cylinder:fov=140",
                                 "stratified_random:seed=7"};
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) texts.emplace_back(kind.name);
  texts.push_back(geometry::make_ray_list_known(spiral()).value());
  for (const std::string& text : texts) {
    const geometry::LayoutName name = geometry::LayoutName::parse(text).value();
    const geometry::RaymapSize size = name.size_for_width(90);
    const auto layout = geometry::make_layout(name, size.width, size.height).value();
    table::TableOptions options;
    options.levels = 1;  // the double-precision blend has no pyramid levels
    options.transition = Transition::kFeather;
    const auto table = table::compile_blend_table(heads.rig, *layout, GetParam(), heads.formats, options);
    ASSERT_TRUE(table) << text << ": " << table.error().text();
    Picture raymap(table->format, table->width, table->height, 77);
    blend::blend_rows(*table, PreparedHeads(*table, heads.views).views(), blend::calibrated_tone(*table),
                      raymap.mutable_view(), 0, table->height);
    const auto sampler = table::RaySampler::make(heads.rig, *layout, GetParam(), heads.formats, options).value();
    const std::vector<RealPlane> real = blend_in_double(sampler, heads.views);
    const std::vector<std::uint8_t> rounded = round_to_levels(GetParam(), size.width, size.height, real);
    EXPECT_LE(difference(raymap.bytes, rounded).largest, 1) << text;
    if (GetParam() != PixelFormat::kGrey8) continue;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const bool lit = raymap.bytes[static_cast<std::size_t>(y * size.width + x)] > 0;
        EXPECT_EQ(lit, layout->ray(x + 0.5, y + 0.5).has_value()) << text << " " << x << "," << y;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, EveryLayoutBlended,
                         testing::Values(PixelFormat::kGrey8, PixelFormat::kRgb24, PixelFormat::kI420));

}  // namespace
}  // namespace nodal::test
