#include "stitch/view/resampler.h"

#include <gtest/gtest.h>

#include "scene.h"
#include "tests/support/layouts.h"

namespace nodal::view {
namespace {

using test::layout_of;

/// As fine as an equirectangular raymap of this width.
std::unique_ptr<geometry::RaymapLayout> as_fine_as(std::string_view text, double width) {
  return layout_of(text, geometry::LayoutName::parse(text).value().width_for_resolution(width / 6.283));
}

std::vector<std::string> whole_spheres() {
  std::vector<std::string> texts{"cube:pad=3", "equiangular_cube:pad=2", "cube_cross:pad=1"};
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    if (test::holds_whole_sphere(kind)) texts.emplace_back(kind.name);
  }
  return texts;
}

class Resampling : public testing::TestWithParam<Filter> {
 protected:
  const parallel::Workers workers_{2};
};

TEST_P(Resampling, EveryLayout_ToEquirectangular_ShowsTheSceneWhereItWas) {
  const auto sphere = layout_of("equirectangular", 160);
  for (const std::string& text : whole_spheres()) {
    const auto from = as_fine_as(text, 320);
    const Resampler resampler(*from, GetParam(), workers_);
    const DecodedImage picture = picture_of(Target::of(*from));
    const Off off = off_scene(resampler.resample(picture.view(), Target::of(*sphere), workers_), Target::of(*sphere));
    // A pixel of the raymap is 1/51 radian, at most about 15 levels; regular layouts are within a twentieth of it. Next
    // to the poles the equal-area cylinder has one row for 8 degrees.
    const bool rough = from->scattered() || GetParam() == Filter::kNearest || text == "cylinder_equal_area";
    EXPECT_LT(off.rms, rough ? 6 : 0.75) << text;
    EXPECT_LT(off.worst, text.starts_with("stratified") ? 80 : rough ? 45 : 6) << text;
  }
}

TEST_P(Resampling, EquirectangularToEveryLayout_ShowsTheSceneWhereItWas) {
  const auto sphere = layout_of("equirectangular", 320);
  const Resampler resampler(*sphere, GetParam(), workers_);
  const DecodedImage picture = picture_of(Target::of(*sphere));
  for (const std::string& text : whole_spheres()) {
    const auto to = as_fine_as(text, 160);
    const Off off = off_scene(resampler.resample(picture.view(), Target::of(*to), workers_), Target::of(*to));
    EXPECT_LT(off.rms, GetParam() == Filter::kNearest ? 5 : 0.75) << text;
    EXPECT_LT(off.worst, GetParam() == Filter::kNearest ? 16 : 8) << text;
  }
}

INSTANTIATE_TEST_SUITE_P(Filters, Resampling,
                         testing::Values(Filter::kNearest, Filter::kBilinear, Filter::kBicubic, Filter::kLanczos));

TEST(Resampler, AnyNumberOfThreads_GivesTheSameBytes) {
  const auto from = layout_of("icosahedron", 200), to = layout_of("healpix", 96);
  const DecodedImage picture = picture_of(Target::of(*from));
  const parallel::Workers one(1), three(3);
  const Resampler resampler(*from, Filter::kBicubic, one), same(*from, Filter::kBicubic, three);
  EXPECT_EQ(resampler.resample(picture.view(), Target::of(*to), one).bytes,
            same.resample(picture.view(), Target::of(*to), three).bytes);
}

TEST(Resampler, LargerPixels_AreTheMeanOfWhatTheyCover) {
  const parallel::Workers workers(2);
  const auto fine = layout_of("equirectangular", 512);
  DecodedImage board{PixelFormat::kGrey8, 512, 256, {}};
  for (int k = 0; k < 512 * 256; ++k) board.bytes.push_back((k % 512 + k / 512) % 2 == 0 ? 40 : 200);
  for (const char* text : {"equirectangular", "cylinder_equal_area", "hammersley"}) {
    const auto coarse = layout_of(text, 128);
    const DecodedImage small =
        Resampler(*fine, Filter::kBilinear, workers).resample(board.view(), Target::of(*coarse), workers);
    // The middle rows; a picture of every fourth pixel would be 40 or 200 throughout.
    int least = 255, most = 0;
    for (int j = 0; j < coarse->height(); ++j) {
      for (int i = 0; i < coarse->width(); ++i) {
        if (std::abs(coarse->ray(i + 0.5, j + 0.5)->y()) > 0.3) continue;
        const int got = small.bytes[static_cast<std::size_t>(j * coarse->width() + i)];
        least = std::min(least, got), most = std::max(most, got);
      }
    }
    EXPECT_GE(least, 100) << text;
    EXPECT_LE(most, 140) << text;
  }
}

TEST(Resampler, SmallestRaymaps_AreSampledWithoutReadingOutside) {
  const parallel::Workers workers(1);
  for (const std::string& text : whole_spheres()) {
    const auto from = layout_of(text, 1);
    const auto to = layout_of("cube", 24);
    const DecodedImage picture = picture_of(Target::of(*from));
    for (const Filter filter : {Filter::kNearest, Filter::kBilinear, Filter::kBicubic}) {
      const DecodedImage made = Resampler(*from, filter, workers).resample(picture.view(), Target::of(*to), workers);
      EXPECT_GT(*std::ranges::max_element(made.bytes), 0) << text;
    }
  }
}

}  // namespace
}  // namespace nodal::view
