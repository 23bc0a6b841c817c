// Complete calibrations from rendered photographs: noise, blur, tilt, uneven light, lenses as in the paper.
#include "stitch/calibration/lens/calibrate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/support/photographer.h"

namespace nodal::calibration {
namespace {

namespace ph = nodal::photographer;

const PatternRaster& pattern() {
  static const PatternRaster raster = *make_pattern({2048, 1448, 1});
  return raster;
}

ph::Scene print() { return ph::print_of(pattern().width, pattern().height, pattern().values); }

/// A smaller head with the paper's lens, so that a test takes seconds.
ph::Lens paper_lens() {
  ph::Lens lens;
  lens.width = 480;
  lens.height = 320;
  lens.f = 326;
  lens.cx = 241.2;
  lens.cy = 153.7;
  lens.aspect = 1.083;
  lens.k = {2.29e-6 * 2.25, 1.65e-11 * 5.0625};
  return lens;
}

struct Placement {
  double tilt, about, spin;
};

std::vector<LensPhotograph> photographs(const ph::Scene& scene, const ph::Lens& lens,
                                        const std::vector<Placement>& placements, double distance,
                                        const ph::Shot& like = {}) {
  std::vector<LensPhotograph> photos;
  for (const Placement& p : placements) {
    ph::Shot shot = like;
    shot.tilt_deg = p.tilt;
    shot.tilt_about_deg = p.about;
    shot.spin_deg = p.spin;
    shot.distance = distance;
    shot.seed = photos.size() + 1;
    shot.blur_px = 0.6 + 0.15 * static_cast<double>(photos.size() % 3);
    const ph::Photo photo = ph::take(scene, lens, shot);
    LensPhotograph out{"photo" + std::to_string(photos.size()) + ".png", GreyImage(photo.width, photo.height)};
    for (std::size_t i = 0; i < photo.grey.size(); ++i) {
      out.luma.values[i] = static_cast<float>(photo.grey[i]) / 255.0F;
    }
    photos.push_back(std::move(out));
  }
  return photos;
}

/// The calibrated lens in the renderer's form.
ph::Lens as_rendered(const HeadCalibration& head, const ph::Lens& truth) {
  ph::Lens lens = truth;
  lens.cx = head.center_x;
  lens.cy = head.center_y;
  lens.aspect = head.aspect;
  if (const auto* tsai = std::get_if<TsaiLens>(&head.lens)) {
    lens.kind = ph::Lens::Kind::kTsai;
    lens.f = tsai->focal;
    lens.k = {tsai->kappa1, tsai->kappa2};
  } else {
    const auto& kb = std::get<KannalaBrandtLens>(head.lens);
    lens.kind = ph::Lens::Kind::kKannalaBrandt;
    lens.f = kb.focal;
    lens.k = kb.k;
  }
  return lens;
}

/// The distance between the pixels that two lenses give to a picture's rays, px rms; no rotation is removed.
double mapping_error_px(const ph::Lens& found, const ph::Lens& truth, double farthest_px) {
  double sum = 0;
  int count = 0;
  for (int j = 0; j < truth.height; j += 4) {
    for (int i = 0; i < truth.width; i += 4) {
      const double u = i + 0.5, v = j + 0.5;
      if (std::hypot(u - truth.cx, v - truth.cy) > farthest_px) continue;
      const auto a = truth.ray(u, v), b = found.ray(u, v);
      constexpr double kStep = 1e-3;
      const auto ax = truth.ray(u + kStep, v), ay = truth.ray(u, v + kStep);
      double xx = 0, xy = 0, yy = 0, px = 0, py = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const double jx = (ax[k] - a[k]) / kStep, jy = (ay[k] - a[k]) / kStep, d = b[k] - a[k];
        xx += jx * jx, xy += jx * jy, yy += jy * jy, px += jx * d, py += jy * d;
      }
      const double det = xx * yy - xy * xy;
      sum += std::pow((yy * px - xy * py) / det, 2) + std::pow((xx * py - xy * px) / det, 2);
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

const std::vector<Placement> kThree{{8, 0, 0}, {30, 40, 10}, {28, 200, 95}};

TEST(CalibrateLens, NoiseBlurTiltAndUnevenLight_LensOfThePaperToThreeHundredthsOfAPixel) {
  ph::Shot shot;
  shot.noise = 4;
  shot.light_x = 0.5;
  shot.light_y = -0.3;
  shot.light_xx = -0.6;
  shot.vignetting = {-0.3, 0.05, 0};
  const ph::Lens lens = paper_lens();
  const auto result = calibrate_lens(photographs(print(), lens, kThree, 0.3, shot), pattern(), {});
  ASSERT_TRUE(result) << result.error().text();
  const double error = mapping_error_px(as_rendered(result->head, lens), lens, 1e9);
  RecordProperty("mapping_rms_px", std::to_string(error));
  EXPECT_LE(error, 0.03);
  EXPECT_NEAR(result->report.focal.value, lens.f, 5 * result->report.focal.deviation + 0.02);
  EXPECT_LT(result->report.focal.deviation, 0.3);
  EXPECT_GT(result->report.covered, 0.95);
  for (const ViewReport& view : result->report.views) EXPECT_LT(view.rms, 6) << view.name;
  EXPECT_NEAR(result->report.views[1].tilt_deg, 30, 0.05);
  EXPECT_NEAR(result->report.views[1].distance, 0.3, 0.001);
}

// The pattern is square, as wide as 1 of its own widths; from 0.9 of them its middle fills half of the picture.
TEST(CalibrateLens, PhotographsFromFarAway_SayWhichRadiiTheyShow) {
  const ph::Lens lens = paper_lens();
  const auto far = calibrate_lens(photographs(print(), lens, kThree, 0.9), pattern(), {});
  ASSERT_TRUE(far) << far.error().text();
  // Head on, half a width is at f * 0.5 / 0.9, and a corner farther by the square root of 2.
  const double side = lens.f * 0.5 / 0.9;
  EXPECT_EQ(far->report.seen_from_px, 0);
  EXPECT_GT(far->report.seen_to_px, side - 20);
  EXPECT_LT(far->report.seen_to_px, 1.5 * side + 20);
  const std::string range = std::to_string(std::lround(far->report.seen_to_px)) + " px from the lens's centre";
  EXPECT_TRUE(std::ranges::any_of(far->report.notes,
                                  [&](const std::string& note) { return note.find(range) != std::string::npos; }));
  const auto near = calibrate_lens(photographs(print(), lens, kThree, 0.3), pattern(), {});
  ASSERT_TRUE(near) << near.error().text();
  const double corner = std::hypot(lens.width, lens.height) / 2;
  EXPECT_NEAR(near->report.seen_to_px, corner, 0.08 * corner);
}

TEST(CalibrateLens, EvenLight_ResponseAndFallOffComeWithIt) {
  ph::Shot shot;
  shot.noise = 2;
  shot.vignetting = {-0.3, 0.05, 0};
  const ph::Lens lens = paper_lens();
  const auto result = calibrate_lens(photographs(print(), lens, kThree, 0.3, shot), pattern(), {});
  ASSERT_TRUE(result) << result.error().text();
  ASSERT_EQ(result->head.response.curve, Response::Curve::kGamma);
  EXPECT_NEAR(result->head.response.gamma, 2.2, 0.1);
  const auto& v = result->head.vignetting.coefficients;
  const double rendered_radius = std::hypot(lens.width, lens.height) / 2;
  for (const double r : {80.0, 150.0, 220.0}) {
    const double s = std::pow(r / result->head.vignetting.radius, 2);
    const double truth = std::pow(r / rendered_radius, 2);
    EXPECT_NEAR(1 + s * (v[0] + s * (v[1] + s * v[2])), 1 - 0.3 * truth + 0.05 * truth * truth, 0.02);
  }
}

TEST(CalibrateLens, CircularFisheye_ItsCircleIsFoundAndItsLensFitted) {
  ph::Lens lens;
  lens.kind = ph::Lens::Kind::kKannalaBrandt;
  lens.width = 420;
  lens.height = 400;
  lens.f = 150;
  lens.cx = 214;
  lens.cy = 196;
  lens.k = {-0.03, 0.004, -0.001, 0};
  const double radius = 185;
  auto photos = photographs(print(), lens, {{5, 0, 0}, {32, 45, 20}, {30, 220, 100}, {25, 130, 200}}, 0.14);
  for (LensPhotograph& photo : photos) {
    for (int j = 0; j < lens.height; ++j) {
      for (int i = 0; i < lens.width; ++i) {
        if (std::hypot(i + 0.5 - 214, j + 0.5 - 196) > radius) photo.luma.row(j)[i] = 0.01F;
      }
    }
  }
  LensOptions options;
  options.kind = LensKind::kKannalaBrandt;
  const auto result = calibrate_lens(photos, pattern(), options);
  ASSERT_TRUE(result) << result.error().text();
  ASSERT_TRUE(result->head.region.circle);
  EXPECT_NEAR(result->head.region.circle->radius, radius, 3);
  EXPECT_LE(mapping_error_px(as_rendered(result->head, lens), lens, 180), 0.05);
}

TEST(CalibrateLens, SomethingStandsBeforeThePattern_TheLensIsFoundAllTheSame) {
  const ph::Lens lens = paper_lens();
  auto photos = photographs(print(), lens, kThree, 0.3);
  for (LensPhotograph& photo : photos) {
    for (int j = 200; j < 320; ++j) {
      for (int i = 60; i < 130; ++i) photo.luma.row(j)[i] = 0.7F;  // an arm
    }
  }
  const auto result = calibrate_lens(photos, pattern(), {});
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_LE(mapping_error_px(as_rendered(result->head, lens), lens, 1e9), 0.05);
}

TEST(CalibrateLens, PhotographOfSomethingElse_IsRefusedByItsName) {
  const ph::Lens lens = paper_lens();
  auto photos = photographs(print(), lens, {{20, 0, 0}}, 0.3);
  photos.push_back(photographs(ph::chessboard(9, 6), lens, {{20, 0, 0}}, 0.5)[0]);
  photos[1].name = "kitchen.jpg";
  const auto refused = calibrate_lens(photos, pattern(), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kNotDetermined);
  EXPECT_NE(refused.error().message.find("kitchen.jpg: the pattern is not in this photograph"), std::string::npos)
      << refused.error().message;
}

TEST(CalibrateLens, MirroredPhotograph_IsRefusedByItsName) {
  auto photos = photographs(print(), paper_lens(), {{20, 0, 0}, {20, 120, 0}}, 0.3);
  for (int j = 0; j < photos[0].luma.height; ++j) {
    std::reverse(photos[0].luma.row(j), photos[0].luma.row(j) + photos[0].luma.width);
  }
  const auto refused = calibrate_lens(photos, pattern(), {});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("photo0.png"), std::string::npos);
}

TEST(CalibrateLens, AllHeadOn_FocalLengthIsNotDeterminedAndItIsSaid) {
  const auto refused =
      calibrate_lens(photographs(print(), paper_lens(), {{0, 0, 0}, {0, 0, 90}, {1, 0, 45}}, 0.3), pattern(), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kNotDetermined);
  EXPECT_NE(refused.error().message.find("20 to 40 degrees"), std::string::npos) << refused.error().message;
}

TEST(CalibrateLens, AllFromOnePlace_AreRefusedAsOneView) {
  ph::Shot shot;
  shot.noise = 3;
  const auto refused = calibrate_lens(
      photographs(print(), paper_lens(), {{25, 40, 0}, {25.5, 41, 1}, {25, 40, 0}}, 0.3, shot), pattern(), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kNotDetermined);
  EXPECT_NE(refused.error().message.find("all 3 photographs are taken from one place"), std::string::npos)
      << refused.error().message;
}

TEST(CalibrateLens, OnePhotograph_IsTooFew) {
  const auto refused = calibrate_lens(photographs(print(), paper_lens(), {{25, 40, 0}}, 0.3), pattern(), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kNotDetermined);
  EXPECT_NE(refused.error().message.find("1 photograph is too few"), std::string::npos) << refused.error().message;
}

TEST(CalibrateLens, PhotographsOfTwoSizes_AreRefusedByName) {
  auto photos = photographs(print(), paper_lens(), {{20, 0, 0}}, 0.3);
  photos.push_back({"other.png", GreyImage(300, 200)});
  const auto refused = calibrate_lens(photos, pattern(), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadValue);
  EXPECT_NE(refused.error().message.find("other.png"), std::string::npos);
  EXPECT_FALSE(calibrate_lens({}, pattern(), {}));
}

TEST(CalibrateLens, WorkSpreadInAnyOrder_GivesTheSameBits) {
  const auto photos = photographs(print(), paper_lens(), {{25, 0, 0}, {25, 120, 40}}, 0.3);
  LensOptions backwards;
  backwards.for_each = [](int count, const std::function<void(int)>& work) {
    for (int i = count - 1; i >= 0; --i) work(i);
  };
  const auto a = calibrate_lens(photos, pattern(), {});
  const auto b = calibrate_lens(photos, pattern(), backwards);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->head, b->head);
}

}  // namespace
}  // namespace nodal::calibration
