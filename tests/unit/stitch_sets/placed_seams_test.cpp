// Placed seams as a rig has them: views of the heads' pictures on a small map, seams from period to period.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/offline/offline_blend.h"
#include "stitch/sets/placed_seams.h"
#include "stitch/sets/seam_views.h"
#include "stitch/sets/set_blend.h"
#include "stitch/sets/table_job.h"
#include "stitch/table/tone_compiler.h"
#include "tests/support/rendered_rig.h"

namespace nodal::sets {
namespace {

constexpr int kWidth = 256;
using Bytes = std::vector<std::uint8_t>;

RaymapConfig config_with(SeamPlacement seams) {
  RaymapConfig config;
  config.width = kWidth;
  config.height = kWidth / 2;
  config.format = PixelFormat::kGrey8;
  config.seams = seams;
  return config;
}

InstalledPtr installed(const Calibration& rig, SeamPlacement seams) {
  const RaymapConfig config = config_with(seams);
  auto job = TableJob::make(rig, config, Fields::kProgressive,
                            std::vector<PixelFormat>(rig.heads.size(), PixelFormat::kGrey8));
  while (!job->done()) job->compile_some(64);
  auto tables = std::move(*job).finish().value();
  std::shared_ptr<const SeamViews> views;
  if (seams == SeamPlacement::kPlaced) views = SeamViews::make(rig, config, tables).value();
  return make_installed({}, "rig", std::move(tables), {}, table::compile_tone_table(rig, config.format, true), {},
                        std::move(views));
}

std::vector<SetFrame> set_of(const test::RenderedRig& seen) {
  std::vector<SetFrame> set;
  for (const ImageView& frame : seen.frames()) set.push_back({true, frame, {}, Exposure::microseconds(8000), {}, 0});
  return set;
}

/// Blends sets as a rig does whose seams are never late.
class Film {
 public:
  Film(const Calibration& rig, SeamPlacement seams) { blend_.adopt(installed(rig, seams)); }

  Bytes blend(const std::vector<SetFrame>& set) {
    const std::uint64_t number = next_++;
    const bool first = number % kSeamPeriod == 0;
    if (first && placed_) {
      blend_.adopt(std::move(placed_));
      ++moved;
    }
    blend_.begin(set);
    if (first && blend_.installed()->seams) {
      blend_.begin_views();
      for (std::size_t k = 0; k < blend_.to_view(); ++k) blend_.view(k);
      placed_ = place_seams(*blend_.installed());
    }
    Bytes raymap(std::size_t{kWidth} * kWidth / 2);
    blend_.begin_raymap(0, raymap.data());
    for (std::size_t k = 0; k < blend_.to_prepare(); ++k) blend_.prepare(k);
    blend_.blend(0, kWidth / 2);
    return raymap;
  }
  const InstalledCalibration& now() const { return *blend_.installed(); }

  int moved = 0;

 private:
  SetBlend blend_;
  InstalledPtr placed_;
  std::uint64_t next_ = 0;
};

TEST(PlacedSeams, Views_AreWhatTheHeadsSee) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const test::RenderedRig seen = test::render_rig(test::six_fisheyes(160), town);
  Film film(seen.truth, SeamPlacement::kPlaced);
  film.blend(set_of(seen));
  const SeamPictures& pictures = *film.now().seam_pictures;
  EXPECT_EQ(pictures.heads, 0b111111U);
  const auto layout = geometry::make_layout("equirectangular", SeamViews::kMapWidth, SeamViews::kMapWidth / 2).value();
  const auto heads = geometry::make_heads(seen.truth).value();
  // The mean difference from the scene, of a view that is moved by some columns.
  const auto difference = [&](std::size_t h, int moved) {
    double off = 0, count = 0;
    for (std::size_t p = 0; p < pictures.views[h].size(); ++p) {
      const int x = static_cast<int>(p) % SeamViews::kMapWidth, y = static_cast<int>(p) / SeamViews::kMapWidth;
      const auto ray = layout->ray(x + 0.5, y + 0.5);
      const auto at = heads[h].project(*ray);
      if (!at || heads[h].distance_to_edge(*at) < 6 || x + moved < 0 || x + moved >= SeamViews::kMapWidth) continue;
      const Eigen::Vector3d d = ray->direction();
      const hal::sim::Light light = town->light({d.x(), d.y(), d.z()}, 0.02);
      off += std::abs(pictures.views[h][p + static_cast<std::size_t>(moved)] -
                      255 * std::clamp(0.299 * light.r + 0.587 * light.g + 0.114 * light.b, 0.0, 1.0));
      ++count;
    }
    return off / count;
  };
  for (std::size_t h = 0; h < heads.size(); ++h) {
    EXPECT_LT(difference(h, 0), 10) << h;
    EXPECT_LT(difference(h, 0), difference(h, 1)) << h;
    EXPECT_LT(difference(h, 0), difference(h, -1)) << h;
  }
}

TEST(PlacedSeams, HeadsWithOtherExposures_AreComparedAsIfTheyHadTheSame) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  test::RenderedRig seen = test::render_rig(test::six_fisheyes(160), town);
  for (std::uint8_t& sample : seen.bytes[1]) sample /= 2;
  const auto difference = [&](std::int64_t exposure_of_head_1_us) {
    std::vector<SetFrame> set = set_of(seen);
    set[1].exposure = Exposure::microseconds(exposure_of_head_1_us);
    Film film(seen.truth, SeamPlacement::kPlaced);
    film.blend(set);
    const SeamPictures& pictures = *film.now().seam_pictures;
    double off = 0, count = 0;
    for (std::size_t p = 0; p < pictures.views[0].size(); ++p) {
      if (pictures.views[0][p] == 0 || pictures.views[1][p] == 0) continue;
      off += std::abs(pictures.views[0][p] - pictures.views[1][p]);
      ++count;
    }
    return off / count;
  };
  EXPECT_GT(difference(8000), 15) << "half the numbers with the same exposure";
  EXPECT_LT(difference(4000), 8) << "a linear response: half the light, half the numbers";
}

/// A room with people who walk around the rig at 1.5 m.
test::Room people(double turned) {
  test::Room room{test::Room::Shape::kBox, 4, {}};
  for (int k = 0; k < 3; ++k) {
    const double yaw = 2.1 * k + turned * (k % 2 == 0 ? 1 : -1);
    room.columns.push_back({1.5 * std::sin(yaw), 1.5 * std::cos(yaw), 0.25});
  }
  return room;
}

TEST(PlacedSeams, APersonOnASeam_CostsLessThanWithFixedSeams) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  test::Room room{test::Room::Shape::kBox, 4, {}};
  for (const double yaw : {0.785, 2.356, -0.785, -2.356})
    room.columns.push_back({1.5 * std::sin(yaw), 1.5 * std::cos(yaw), 0.25});
  const test::RenderedRig seen = test::render_rig_in(room, test::spread_out(test::six_fisheyes(160), 0.1), town);
  Film film(seen.truth, SeamPlacement::kPlaced);
  const Bytes fixed = film.blend(set_of(seen));
  for (std::uint64_t k = 1; k < kSeamPeriod; ++k) EXPECT_EQ(film.blend(set_of(seen)), fixed) << "of set " << k;
  const Bytes placed = film.blend(set_of(seen));
  EXPECT_NE(placed, fixed) << "from the second period on";
  EXPECT_EQ(film.moved, 1);
  // Columns are 0.5 m wide: at 1.5 m 19 degrees, 14 px. On the horizon, each px of the truth is looked for in its neighbourhood.
  const auto truth = test::what_a_rig_sees(room, {}, town);
  const auto layout = geometry::make_layout("equirectangular", kWidth, kWidth / 2).value();
  Bytes best(fixed.size());
  for (std::size_t p = 0; p < best.size(); ++p) {
    const Eigen::Vector3d d =
        layout->ray(static_cast<double>(p % kWidth) + 0.5, static_cast<double>(p / kWidth) + 0.5)->direction();
    const hal::sim::Light light = truth->light({d.x(), d.y(), d.z()}, 0.02);
    best[p] = static_cast<std::uint8_t>(
        std::lround(255 * std::clamp(0.299 * light.r + 0.587 * light.g + 0.114 * light.b, 0.0, 1.0)));
  }
  // How well windows of the truth around the four columns are found in a raymap, anywhere near: parallax moves things, a cut
  // breaks them.
  const auto found = [&](const Bytes& raymap) {
    double sum = 0, count = 0;
    for (int y = 40; y < 88; y += 4) {
      for (const int column : {32, 96, 160, 224}) {
        double most = -1;
        for (int dx = -10; dx <= 10; ++dx) {
          for (int dy = -3; dy <= 3; ++dy) {
            double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
            for (int k = 0; k < 16 * 10; ++k) {
              const int x = column - 8 + k % 16, j = y - 5 + k / 16;
              const double p = best[static_cast<std::size_t>(j * kWidth + x)];
              const double q = raymap[static_cast<std::size_t>((j + dy) * kWidth + x + dx)];
              a += p, b += q, aa += p * p, bb += q * q, ab += p * q;
            }
            const double n = 160;
            most = std::max(most, (n * ab - a * b) / std::sqrt(std::max(1.0, (n * aa - a * a) * (n * bb - b * b))));
          }
        }
        sum += most;
        ++count;
      }
    }
    return sum / count;
  };
  EXPECT_GT(found(placed), found(fixed) + 0.02);
}

/// By pixel, the variance of its level from frame to frame.
class Variance {
 public:
  void add(const Bytes& raymap) {
    sum_.resize(raymap.size());
    squares_.resize(raymap.size());
    for (std::size_t p = 0; p < raymap.size(); ++p) {
      sum_[p] += raymap[p];
      squares_[p] += raymap[p] * raymap[p];
    }
    ++count_;
  }
  double at(std::size_t p) const { return squares_[p] / count_ - sum_[p] / count_ * (sum_[p] / count_); }

 private:
  std::vector<double> sum_, squares_;
  double count_ = 0;
};

TEST(PlacedSeams, PeopleWalk_StaticPartsFlickerAsTheHeadsNoiseDoes) {
  constexpr int kFrames = 300 + static_cast<int>(kSeamPeriod), kStands = 5;  // frames for which people stand still
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const Calibration rig = test::spread_out(test::six_fisheyes(120), 0.1);
  table::TableOptions all;
  all.transition = table::Transition::kFeather;
  const auto every_head = offline::OfflineBlend::make(rig, {"equirectangular", kWidth, kWidth / 2, PixelFormat::kGrey8},
                                                      all, PixelFormat::kGrey8, 1);
  ASSERT_TRUE(every_head);
  Film placed(rig, SeamPlacement::kPlaced), fixed(rig, SeamPlacement::kFixed);
  Variance of_placed, of_fixed;
  Bytes least(std::size_t{kWidth} * kWidth / 2, 255), most(least.size(), 0);
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 2);
  for (int frame = 0; frame < kFrames;) {
    const test::RenderedRig seen =
        test::render_rig_in(people(2.0 * frame / kFrames), rig, town, {PixelFormat::kGrey8, 0, 1, 1});
    const Bytes clean = every_head->blend(seen.frames()).value().bytes;
    for (std::size_t p = 0; p < clean.size(); ++p) {
      least[p] = std::min(least[p], clean[p]);
      most[p] = std::max(most[p], clean[p]);
    }
    for (int k = 0; k < kStands; ++k, ++frame) {
      test::RenderedRig noisy = seen;
      for (auto& bytes : noisy.bytes)
        for (std::uint8_t& level : bytes)
          level = static_cast<std::uint8_t>(std::clamp(std::lround(level + noise(random)), 0L, 255L));
      const Bytes of_set = placed.blend(set_of(noisy)), as_fixed = fixed.blend(set_of(noisy));
      if (frame < static_cast<int>(kSeamPeriod)) continue;  // then fixed seams are replaced by the first placed ones
      of_placed.add(of_set);
      of_fixed.add(as_fixed);
    }
  }
  double flicker = 0, of_noise = 0, count = 0;
  for (std::size_t p = 0; p < least.size(); ++p) {
    if (most[p] - least[p] > 1) continue;  // no head sees anybody there
    flicker += of_placed.at(p);
    of_noise += of_fixed.at(p);
    ++count;
  }
  EXPECT_GT(placed.moved, 5) << "seams follow the people";
  EXPECT_GT(count, 0.3 * static_cast<double>(least.size()));
  EXPECT_LT(std::sqrt(flicker), 1.1 * std::sqrt(of_noise));
}

}  // namespace
}  // namespace nodal::sets
