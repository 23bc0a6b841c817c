// Two bands from calibration to pixels. Expected values follow from the rig's symmetry and from geometry.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "protocol/base/angles.h"
#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/table_compiler.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"

namespace nodal::table {
namespace {

using test::Picture;

constexpr int kSide = 800;

TableOptions two_bands() {
  TableOptions options;
  options.transition = Transition::kTwoBand;
  options.seam_width_deg = 1;
  options.sharpen = 0;
  return options;
}

/// Two fisheyes of 220 degrees, back to back: by symmetry the seam is the great circle z = 0, and 20 degrees on both
/// sides of it are seen by both.
Calibration back_to_back() {
  Calibration rig;
  rig.name = "two";
  for (const double yaw : {0.0, 180.0}) {
    HeadCalibration head =
        test::head_at("h" + std::to_string(rig.heads.size()), kSide, kSide, EquidistantLens{{200}}, {yaw, 0, 0});
    head.max_angle = 110 * kRadiansPerDegree;
    head.region.circle = {kSide / 2.0, kSide / 2.0, 200 * head.max_angle};
    rig.heads.push_back(head);
  }
  return rig;
}

Picture raymap_of(const Calibration& rig, const RaymapSpec& spec, const std::vector<Picture>& pictures,
                  const TableOptions& options) {
  std::vector<PixelFormat> formats;
  std::vector<ImageView> views;
  for (const Picture& picture : pictures) {
    formats.push_back(picture.format);
    views.push_back(picture.bytes.empty() ? ImageView{} : picture.view());
  }
  const blend::BlendTable table = compile_blend_table(rig, spec, formats, options).value();
  Picture raymap(spec.format, spec.width, spec.height);
  blend::blend_rows(table, test::PreparedHeads(table, views).views(), blend::calibrated_tone(table),
                    raymap.mutable_view(), 0, spec.height);
  return raymap;
}

/// The angle of a ray of an equirectangular raymap from the seam of back_to_back(), positive on the first head's side.
double from_seam(int x, int y, int width) {
  const double theta = ((x + 0.5) / width - 0.5) * 2 * std::numbers::pi;
  const double phi = ((y + 0.5) / (width / 2.0) - 0.5) * std::numbers::pi;
  return std::asin(std::cos(phi) * std::cos(theta)) / kRadiansPerDegree;
}

const RaymapSpec kSphere{"equirectangular", 512, 256, PixelFormat::kGrey8};

TEST(TwoBands, HeadsOfDifferentBrightness_PassWithoutAStepAndOnlyWhereBothSee) {
  const Picture raymap = raymap_of(
      back_to_back(), kSphere,
      {Picture(PixelFormat::kGrey8, kSide, kSide, 100), Picture(PixelFormat::kGrey8, kSide, kSide, 140)}, two_bands());
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 512; ++x) {
      const int level = raymap.bytes[static_cast<std::size_t>(y * 512 + x)];
      const double angle = from_seam(x, y, 512);
      if (angle > 21) {
        EXPECT_EQ(level, 100) << x << ", " << y;
      } else if (angle < -21) {
        EXPECT_EQ(level, 140) << x << ", " << y;
      } else if (std::abs(angle) < 0.4) {
        EXPECT_NEAR(level, 120, 2) << x << ", " << y;
      }
      // A transition of 40 levels over 40 degrees less the margins: with a smoothstep, never 4 levels a pixel (0.7
      // degrees). Near the poles neighbours are closer.
      if (x > 0) {
        EXPECT_LE(std::abs(level - raymap.bytes[static_cast<std::size_t>(y * 512 + x - 1)]), 4) << x << ", " << y;
      }
    }
  }
  TableOptions seam = two_bands();
  seam.transition = Transition::kSeam;
  const Picture sharp = raymap_of(
      back_to_back(), kSphere,
      {Picture(PixelFormat::kGrey8, kSide, kSide, 100), Picture(PixelFormat::kGrey8, kSide, kSide, 140)}, seam);
  int step = 0;
  for (int x = 1; x < 512; ++x)
    step = std::max(step, std::abs(sharp.bytes[128 * 512 + static_cast<std::size_t>(x)] -
                                   sharp.bytes[128 * 512 + static_cast<std::size_t>(x) - 1]));
  EXPECT_GT(step, 15) << "which is what two bands are for";
}

/// Rings of four pixels about the head's axis: detail that both heads show at any ray near the seam.
Picture rings(int level, int swing) {
  Picture picture(PixelFormat::kGrey8, kSide, kSide);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const double r = std::hypot(x + 0.5 - kSide / 2.0, y + 0.5 - kSide / 2.0);
      picture.bytes[static_cast<std::size_t>(y * kSide + x)] =
          static_cast<std::uint8_t>(std::lround(level + swing * std::sin(r * std::numbers::pi / 4)));
    }
  }
  return picture;
}

TEST(TwoBands, Detail_IsThatOfTheSeam) {
  const RaymapSpec spec{"equirectangular", 1024, 512, PixelFormat::kGrey8};
  TableOptions seam = two_bands();
  seam.transition = Transition::kSeam;
  const std::vector<Picture> pictures{rings(100, 20), rings(140, 20)};
  const Picture sharp = raymap_of(back_to_back(), spec, pictures, seam);
  const Picture both = raymap_of(back_to_back(), spec, pictures, two_bands());
  // Their difference has no detail: it changes by a few levels from pixel to pixel, where the rings change by 20.
  int moved = 0;
  for (int y = 100; y < 412; ++y) {
    for (int x = 1; x < 1024; ++x) {
      if (std::abs(from_seam(x, y, 1024)) < 1) continue;  // the ramp
      const auto at = static_cast<std::size_t>(y * 1024 + x);
      const int here = both.bytes[at] - sharp.bytes[at];
      const int before = both.bytes[at - 1] - sharp.bytes[at - 1];
      EXPECT_LE(std::abs(here - before), 4) << x << ", " << y;
      moved += std::abs(here) > 5 ? 1 : 0;
    }
  }
  EXPECT_GT(moved, 10000) << "it corrects something";
}

TEST(TwoBands, HeadsThatAgree_AreLeftAsTheyAre) {
  std::mt19937 random(3);
  for (int round = 0; round < 20; ++round) {
    const Calibration rig = test::random_rig(random);
    std::vector<Picture> pictures;
    for (const HeadCalibration& head : rig.heads) {
      pictures.emplace_back(PixelFormat::kGrey8, head.width, head.height, std::uint8_t{77});
    }
    const Picture raymap = raymap_of(rig, {"equirectangular", 96, 48, PixelFormat::kGrey8}, pictures, two_bands());
    for (const std::uint8_t level : raymap.bytes) EXPECT_TRUE(level == 77 || level == 0);
  }
}

TEST(TwoBands, AHeadIsMissing_TheOtherIsShownAsItIs) {
  const Picture raymap =
      raymap_of(back_to_back(), kSphere,
                {Picture(PixelFormat::kGrey8, kSide, kSide, 100), Picture(PixelFormat::kGrey8, 0, 0)}, two_bands());
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 512; ++x) {
      const int level = raymap.bytes[static_cast<std::size_t>(y * 512 + x)];
      if (from_seam(x, y, 512) > -16) {
        EXPECT_EQ(level, 100) << x << ", " << y;
      }
      if (from_seam(x, y, 512) < -21) {
        EXPECT_EQ(level, 0) << x << ", " << y;
      }
    }
  }
}

TEST(TwoBands, VignettingThatIsUndone_IsNotCorrectedAgain) {
  Calibration rig = back_to_back();
  std::vector<Picture> pictures;
  for (HeadCalibration& head : rig.heads) {
    head.vignetting = {kSide / 2.0, kSide / 2.0, kSide / 2.0, {-0.5, 0.1, 0}};
    head.gain.fill(pictures.empty() ? 1.0 : 0.9);
    Picture picture(PixelFormat::kGrey8, kSide, kSide);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const double r = std::hypot(x + 0.5 - kSide / 2.0, y + 0.5 - kSide / 2.0) / (kSide / 2.0);
        const double light = 180 * head.gain[0] * (1 - 0.5 * r * r + 0.1 * r * r * r * r);
        picture.bytes[static_cast<std::size_t>(y * kSide + x)] =
            static_cast<std::uint8_t>(std::lround(std::max(0.0, light)));
      }
    }
    pictures.push_back(std::move(picture));
  }
  const Picture raymap = raymap_of(rig, kSphere, pictures, two_bands());
  for (const std::uint8_t level : raymap.bytes) EXPECT_NEAR(level, 180, 1);
}

/// The same two brightnesses on any layout are those of the equirectangular raymap at the same rays.
void expect_like_equirectangular(const geometry::RaymapLayout& layout, PixelFormat format, int within) {
  const std::vector<Picture> pictures{Picture(format, kSide, kSide, 100), Picture(format, kSide, kSide, 140)};
  const RaymapSpec spec{"equirectangular", 1024, 512, format};
  const Picture reference = raymap_of(back_to_back(), spec, pictures, two_bands());
  const blend::BlendTable table =
      compile_blend_table(back_to_back(), layout, format, std::vector(2, format), two_bands()).value();
  Picture raymap(format, layout.width(), layout.height());
  const std::vector<ImageView> views{pictures[0].view(), pictures[1].view()};
  blend::blend_rows(table, test::PreparedHeads(table, views).views(), blend::calibrated_tone(table),
                    raymap.mutable_view(), 0, layout.height());
  const auto sphere = geometry::make_layout("equirectangular", 1024, 512).value();
  int largest = 0;
  for (int y = 0; y < layout.height(); ++y) {
    for (int x = 0; x < layout.width(); ++x) {
      const auto ray = layout.ray(x + 0.5, y + 0.5);
      if (!ray) continue;
      const geometry::Pixel at = sphere->pixel(*ray).value();
      const auto i = static_cast<std::size_t>(std::min(511, static_cast<int>(at.y)) * 1024 +
                                              std::min(1023, static_cast<int>(at.x)));
      largest = std::max(largest,
                         std::abs(raymap.bytes[static_cast<std::size_t>(y * layout.width() + x)] - reference.bytes[i]));
    }
  }
  EXPECT_LE(largest, within) << layout.name() << " of " << layout.width() << " x " << layout.height();
}

TEST(TwoBands, FacesOfACube_AreCorrectedUpToTheirEdges) {
  for (const int side : {256, 272}) {  // faces begin at a block, and in the middle of one
    expect_like_equirectangular(*geometry::make_layout("cube", 3 * side, 2 * side).value(), PixelFormat::kGrey8, 5);
  }
}

/// Rays spread evenly, by the golden angle.
class GoldenSphere final : public geometry::RaymapLayout {
 public:
  GoldenSphere(int width, int height) : RaymapLayout(width, height) {}
  std::string_view name() const override { return "golden"; }
  bool scattered() const override { return true; }
  std::optional<geometry::Ray> ray(double x, double y) const override {
    const int k = static_cast<int>(y) * width() + static_cast<int>(x);
    const double up = 1 - (2.0 * k + 1) / (width() * height());
    const double turn = k * 2.399963229728653;
    const double beside = std::sqrt(1 - up * up);
    return geometry::Ray::towards(beside * std::cos(turn), up, beside * std::sin(turn));
  }
  double solid_angle(int, int) const override { return 4 * std::numbers::pi / (width() * height()); }
  std::optional<geometry::Pixel> pixel(const geometry::Ray&) const override { return std::nullopt; }
};

TEST(TwoBands, RaysInAnyOrder_AreCorrectedByTheirPlaceOnTheSphere) {
  // A tile has one correction, for 3 degrees; 3 levels a degree at the most.
  expect_like_equirectangular(GoldenSphere(512, 512), PixelFormat::kGrey8, 9);
}

TEST(TwoBands, AnyRig_TheTableIsProvenInEveryFormat) {
  std::mt19937 random(11);
  for (int round = 0; round < 40; ++round) {
    const Calibration rig = test::random_rig_with_light(random);
    const PixelFormat format = std::array{PixelFormat::kGrey8, PixelFormat::kRgb24, PixelFormat::kI420}[random() % 3];
    const std::vector<PixelFormat> heads(rig.heads.size(), format == PixelFormat::kI420 ? PixelFormat::kYuyv : format);
    const auto table = compile_blend_table(rig, {"equirectangular", 90, 45, format}, heads, two_bands());
    ASSERT_TRUE(table.has_value() || table.error().code == Errc::kNoCoverage) << table.error().message;
  }
}

}  // namespace
}  // namespace nodal::table
