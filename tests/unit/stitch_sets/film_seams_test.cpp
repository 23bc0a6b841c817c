// Placed seams in films of people, compared with the truth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "film.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/offline/offline_blend.h"

namespace nodal::sets {
namespace {

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
  // Columns are 0.5 m wide: at 1.5 m 19 degrees, 14 px. On the horizon, each px of the truth is looked for in its
  // neighbourhood.
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
  // How well windows of the truth around the four columns are found in a raymap, anywhere near: parallax moves things,
  // a cut breaks them.
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
  all.transition = Transition::kFeather;
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
