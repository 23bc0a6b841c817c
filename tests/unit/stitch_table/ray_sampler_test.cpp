#include "stitch/table/ray_sampler.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "rigs.h"

namespace nodal::table {
namespace {

using test::cube_rig;
using test::random_rig_with_light;

std::unique_ptr<geometry::RaymapLayout> equirectangular(int width) {
  return geometry::make_layout("equirectangular", width, width / 2).value();
}

RC_GTEST_PROP(RaySampler, AnyRig_SamplesLieWhereTheHeadsProjectionSaysAndWeighDensityTimesFeather,
              (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const Calibration rig = random_rig_with_light(random);
  const auto layout = equirectangular(24);
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kRgb24);
  TableOptions options;
  options.interpolation = Interpolation::kPixel;
  options.least_weight = 0;
  options.transition = Transition::kFeather;
  options.feather = 0.5;
  const RaySampler sampler = RaySampler::make(rig, *layout, PixelFormat::kRgb24, formats, options).value();
  RowSampler row(sampler);
  for (int y = 0; y < 12; ++y) {
    row.sample(0, y);
    for (int x = 0; x < 24; ++x) {
      const geometry::Ray ray = layout->ray(x + 0.5, y + 0.5).value();
      // Computed directly by stitch/geometry, head by head.
      std::vector<RaySample> expected;
      double sum = 0;
      for (std::size_t h = 0; h < rig.heads.size(); ++h) {
        const geometry::Head& head = sampler.heads()[h];
        const std::optional<geometry::Pixel> pixel = head.project(ray);
        if (!pixel || head.distance_to_edge(*pixel) < 1e-6) continue;
        const Region& region = rig.heads[h].region;
        const double across = region.circle ? 2 * region.circle->radius : 1e9;
        const double half = std::min({region.right, region.bottom, across}) / 2;
        const double t = std::min(1.0, head.distance_to_edge(*pixel) / (half * 0.5));
        const double weight = head.density(*pixel) * std::max(1e-6, t * t * (3 - 2 * t));
        const Response& response = rig.heads[h].response;
        const double exponent = response.curve == Response::Curve::kGamma ? response.gamma : 1;
        expected.push_back({static_cast<HeadIndex>(h), std::clamp(pixel->x - 0.5, 0.0, head.width() - 1.0),
                            std::clamp(pixel->y - 0.5, 0.0, head.height() - 1.0), weight,
                            std::pow(head.vignetting(*pixel), -1 / exponent)});
        sum += weight;
      }
      RC_ASSERT(row.at(x).size() == expected.size());
      for (std::size_t k = 0; k < expected.size(); ++k) {
        const RaySample& got = row.at(x)[k];
        RC_ASSERT(got.head == expected[k].head);
        RC_ASSERT(std::abs(got.x - expected[k].x) < 1e-7);
        RC_ASSERT(std::abs(got.y - expected[k].y) < 1e-7);
        RC_ASSERT(std::abs(got.weight - expected[k].weight / sum) < 1e-6);
        RC_ASSERT(std::abs(got.gain - expected[k].gain) < 1e-9);
      }
    }
  }
}

// Row k of a field is row 2k + parity of the frame; subsampled chroma comes from rows 4k + parity and 4k + 2 + parity.
RC_GTEST_PROP(RaySampler, AFieldOfAnyRig_IsSampledWhereItsRowsLieInTheFrame, (std::uint32_t seed, bool bottom)) {
  std::mt19937 random(seed);
  Calibration rig = random_rig_with_light(random);
  std::vector<PixelFormat> formats;
  for (HeadCalibration& head : rig.heads) {
    head.height -= head.height % 4;
    head.region.bottom = head.height;
    formats.push_back(std::array{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv}[random() % 3]);
  }
  const auto layout = equirectangular(24);
  TableOptions options;
  options.interpolation = Interpolation::kPixel;
  const RaySampler frames = RaySampler::make(rig, *layout, PixelFormat::kI420, formats, options).value();
  options.field = bottom ? FieldParity::kBottom : FieldParity::kTop;
  const RaySampler fields = RaySampler::make(rig, *layout, PixelFormat::kI420, formats, options).value();
  const double parity = bottom ? 1 : 0;
  RowSampler in_frames(frames);
  RowSampler in_fields(fields);
  for (const int grid : {0, 1}) {
    for (int y = 0; y < frames.grids()[static_cast<std::size_t>(grid)].height; ++y) {
      in_frames.sample(grid, y);
      in_fields.sample(grid, y);
      for (int x = 0; x < in_frames.width(); ++x) {
        RC_ASSERT(in_fields.at(x).size() == in_frames.at(x).size());
        for (std::size_t k = 0; k < in_frames.at(x).size(); ++k) {
          const RaySample& whole = in_frames.at(x)[k];
          const RaySample& field = in_fields.at(x)[k];
          const int rows = rig.heads[whole.head].height / (grid == 1 ? 4 : 2);
          double row = (whole.y - parity) / 2;
          if (grid == 1) {
            // For YUYV the frame's chroma comes from rows 2k, the field's from 4k + parity.
            const bool all_rows = formats[whole.head] == PixelFormat::kYuyv;
            row = all_rows ? (2 * whole.y - parity) / 4 : (2 * (whole.y + 0.5) - 1.5 - parity) / 4;
          }
          RC_ASSERT(field.head == whole.head);
          RC_ASSERT(field.x == whole.x);
          RC_ASSERT(field.weight == whole.weight);
          RC_ASSERT(std::abs(field.y - std::clamp(row, 0.0, rows - 1.0)) < 1e-9);
        }
      }
    }
  }
}

TEST(RaySampler, FramesThatHaveNoTwoFields_AreRefusedByHeadAndRows) {
  Calibration rig = cube_rig(30);
  const auto layout = equirectangular(24);
  TableOptions options;
  options.field = FieldParity::kTop;
  const auto yuv = RaySampler::make(rig, *layout, PixelFormat::kI420, std::vector(6, PixelFormat::kI420), options);
  ASSERT_FALSE(yuv);
  EXPECT_EQ(yuv.error().code, Errc::kUnsupported);
  EXPECT_EQ(yuv.error().message,
            "head 'c0': frames of 30 rows cannot be taken apart into fields; in I420 they have a "
            "multiple of 4, 8 at least");
  EXPECT_TRUE(RaySampler::make(rig, *layout, PixelFormat::kGrey8, std::vector(6, PixelFormat::kGrey8), options));
}

RC_GTEST_PROP(RaySampler, RigAndRaymapRotatedTogether_NothingChanges, (std::uint32_t seed)) {
  /// Another layout, seen from a rotated rig.
  class Turned final : public geometry::RaymapLayout {
   public:
    Turned(const geometry::RaymapLayout& layout, const Eigen::Matrix3d& R_new_old)
        : RaymapLayout(layout.width(), layout.height()), layout_(layout), R_new_old_(R_new_old) {}
    std::string_view name() const override { return "turned"; }
    bool scattered() const override { return false; }
    std::optional<geometry::Ray> ray(double x, double y) const override { return R_new_old_ * *layout_.ray(x, y); }
    double solid_angle(int i, int j) const override { return layout_.solid_angle(i, j); }
    std::optional<geometry::Pixel> pixel(const geometry::Ray& ray) const override {
      return layout_.pixel(R_new_old_.transpose() * ray);
    }

   private:
    const geometry::RaymapLayout& layout_;
    Eigen::Matrix3d R_new_old_;
  };

  std::mt19937 random(seed);
  const auto degrees = [&] { return static_cast<double>(random() % 3600) / 10; };
  const Calibration rig = random_rig_with_light(random);
  const Eigen::Matrix3d R_new_old = geometry::to_R_head_rig({degrees(), degrees() / 4, degrees()});
  Calibration turned_rig = rig;
  for (HeadCalibration& head : turned_rig.heads) {
    head.R_head_rig = geometry::rows_of(geometry::matrix_of(head.R_head_rig) * R_new_old.transpose());
  }
  const auto layout = equirectangular(24);
  const Turned turned_layout(*layout, R_new_old);
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kI420);
  const RaySampler before = RaySampler::make(rig, *layout, PixelFormat::kI420, formats, {}).value();
  const RaySampler after = RaySampler::make(turned_rig, turned_layout, PixelFormat::kI420, formats, {}).value();
  RowSampler row_before(before);
  RowSampler row_after(after);
  for (const int grid : {0, 1}) {
    for (int y = 0; y < before.grids()[static_cast<std::size_t>(grid)].height; ++y) {
      row_before.sample(grid, y);
      row_after.sample(grid, y);
      for (int x = 0; x < row_before.width(); ++x) {
        RC_ASSERT(row_before.at(x).size() == row_after.at(x).size());
        for (std::size_t k = 0; k < row_before.at(x).size(); ++k) {
          const RaySample& a = row_before.at(x)[k];
          const RaySample& b = row_after.at(x)[k];
          RC_ASSERT(a.head == b.head);
          RC_ASSERT(std::abs(a.x - b.x) + std::abs(a.y - b.y) < 1e-7);
          // Seams use differences of tabled lenses, in other directions: up to 2e-4 in thousands of rigs.
          RC_ASSERT(std::abs(a.weight - b.weight) < 1e-3);
          RC_ASSERT(std::abs(a.gain - b.gain) < 1e-9);
        }
      }
    }
  }
}

TEST(RaySampler, ChromaOfEveryFormat_IsSampledWhereItLies) {
  // One pinhole looking forward; a format's chroma sample k has its centre at this luma coordinate. For YUYV and UYVY
  // every second row is used, starting with row 0.
  Calibration rig;
  rig.name = "one";
  rig.heads.push_back(test::head_at("one", 64, 48, TsaiLens{40, 0, 0}, {0, 0, 0}));
  const auto layout = equirectangular(192);
  struct Case {
    PixelFormat format;
    double step_x, first_x, step_y, first_y;
  };
  for (const Case& c : {Case{PixelFormat::kI420, 2, 1.0, 2, 1.0}, Case{PixelFormat::kNv12, 2, 1.0, 2, 1.0},
                        Case{PixelFormat::kYuyv, 2, 0.5, 2, 0.5}, Case{PixelFormat::kUyvy, 2, 0.5, 2, 0.5}}) {
    const std::vector<PixelFormat> formats{c.format};
    TableOptions options;
    options.interpolation = Interpolation::kPixel;
    const RaySampler sampler = RaySampler::make(rig, *layout, PixelFormat::kI420, formats, options).value();
    RowSampler row(sampler);
    int seen = 0;
    for (int y = 0; y < 48; ++y) {
      row.sample(1, y);
      for (int x = 0; x < 96; ++x) {
        if (row.at(x).empty()) continue;
        const RaySample& s = row.at(x)[0];
        // The raymap is I420: its chroma sample (x, y) has the ray of (2x + 1, 2y + 1).
        const geometry::Angles angles = layout->ray(2 * x + 1, 2 * y + 1).value().angles();
        const double u = 32 + 40 * std::tan(angles.theta);
        const double v = 24 + 40 * std::tan(angles.phi) / std::cos(angles.theta);
        const double at_x = c.first_x + s.x * c.step_x;
        const double at_y = c.first_y + s.y * c.step_y;
        // Within half a sample of the edge the edge sample is used.
        EXPECT_NEAR(at_x, std::clamp(u, c.first_x, c.first_x + 31 * c.step_x), 1e-7) << pixel_format_name(c.format);
        EXPECT_NEAR(at_y, std::clamp(v, c.first_y, c.first_y + (48 / c.step_y - 1) * c.step_y), 1e-7);
        ++seen;
      }
    }
    EXPECT_GT(seen, 100);
  }
}

TEST(RaySampler, RayInterpolation_MovesSamplesByLittleAndOnlyWithinTheirFourNeighbours) {
  const Calibration rig = cube_rig(24);
  const auto layout = equirectangular(64);
  const std::vector<PixelFormat> formats(6, PixelFormat::kGrey8);
  TableOptions by_pixel;
  by_pixel.interpolation = Interpolation::kPixel;
  const RaySampler rays = RaySampler::make(rig, *layout, PixelFormat::kGrey8, formats, {}).value();
  const RaySampler pixels = RaySampler::make(rig, *layout, PixelFormat::kGrey8, formats, by_pixel).value();
  RowSampler row_r(rays);
  RowSampler row_p(pixels);
  double largest = 0;
  for (int y = 0; y < 32; ++y) {
    row_r.sample(0, y);
    row_p.sample(0, y);
    for (int x = 0; x < 64; ++x) {
      ASSERT_EQ(row_r.at(x).size(), row_p.at(x).size());
      for (std::size_t k = 0; k < row_r.at(x).size(); ++k) {
        const RaySample& r = row_r.at(x)[k];
        const RaySample& p = row_p.at(x)[k];
        EXPECT_GE(r.x, std::floor(p.x) - 1e-12);
        EXPECT_LE(r.x, std::floor(p.x) + 1 + 1e-12);
        largest = std::max({largest, std::abs(r.x - p.x), std::abs(r.y - p.y)});
      }
    }
  }
  // f(1-f)/2 times the curvature of the arctangent, 1/f at 45 degrees, f = 9: at most 0.014; for both axes 0.03.
  EXPECT_GT(largest, 0.005);
  EXPECT_LT(largest, 0.03);
}

TEST(RaySampler, RayInterpolationThatMovesPlacesByLessThanAThousandth_IsLeftOut) {
  // Along the radius x of a pinhole, the midpoint between two samples is off by an eighth of the arctangent's curvature
  // divided by its slope, 2 x / (f^2 + x^2): less than 1/1024 everywhere for f = 200; for f = 100, which applies to
  // chroma, up to x = 48.
  const Calibration rig = cube_rig(530);
  const auto layout = equirectangular(64);
  const std::vector<PixelFormat> formats(6, PixelFormat::kI420);
  const RaySampler sampler = RaySampler::make(rig, *layout, PixelFormat::kI420, formats, {}).value();
  EXPECT_GT(sampler.plane(0, 0).same_radius, 265 * std::sqrt(2.0) - 1);
  EXPECT_LE(sampler.plane(1, 0).same_radius, 2 * 48.2);
  EXPECT_GT(sampler.plane(1, 0).same_radius, 2 * 30);
}

TEST(RaySampler, GainsOfAHead_AreUndoneByColourInRgbAndByLumaInYuv) {
  Calibration rig = cube_rig(32);
  rig.heads[2].gain = {1.25, 0.8, 0.5};
  const auto layout = equirectangular(16);
  const std::vector<PixelFormat> rgb(6, PixelFormat::kRgb24);
  const std::vector<PixelFormat> yuv(6, PixelFormat::kNv12);
  const auto gains = [&](const std::vector<PixelFormat>& formats, PixelFormat raymap, TableOptions options) {
    return RaySampler::make(rig, *layout, raymap, formats, options).value().optics()[2].gain;
  };
  const std::array<double, 3> colours = gains(rgb, PixelFormat::kRgb24, {});
  EXPECT_NEAR(colours[0], 0.8, 1e-12);
  EXPECT_NEAR(colours[1], 1.25, 1e-12);
  EXPECT_NEAR(colours[2], 2.0, 1e-12);
  const double luma = 1 / (0.299 * 1.25 + 0.587 * 0.8 + 0.114 * 0.5);
  for (const double gain : gains(yuv, PixelFormat::kI420, {})) EXPECT_NEAR(gain, luma, 1e-12);
  TableOptions as_it_is;
  as_it_is.undo_gain = false;
  for (const double gain : gains(rgb, PixelFormat::kRgb24, as_it_is)) EXPECT_EQ(gain, 1);
}

}  // namespace
}  // namespace nodal::table
