// The pyramid's steps on the sphere: they commute with rotations of it, also over poles and 180 degrees.
#include "stitch/bands/pyramid.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace nodal::bands {
namespace {

constexpr double kPi = std::numbers::pi;
using Direction = std::array<double, 3>;

Direction direction(Grid grid, double u, double v) {
  const double theta = (u / grid.width - 0.5) * 2 * kPi, phi = (v / grid.height - 0.5) * kPi;
  return {std::sin(theta) * std::cos(phi), std::sin(phi), std::cos(theta) * std::cos(phi)};
}

/// A bump about a direction, `width` rad wide.
double bump(const Direction& at, const Direction& centre, double width) {
  const double dot = at[0] * centre[0] + at[1] * centre[1] + at[2] * centre[2];
  return std::exp((dot - 1) / (width * width));
}

Layer picture(Grid grid, const Direction& centre, double width) {
  Layer made(grid, Window::all(grid), 1);
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      made.at(x, y)[0] = static_cast<float>(bump(direction(grid, x + 0.5, y + 0.5), centre, width));
    }
  }
  return made;
}

const parallel::Workers kWorkers(2);
constexpr Grid kFine{200, 101}, kCoarse{100, 51};

TEST(Pyramid, ABumpAnywhere_IsReducedAsABumpAtTheEquator) {
  constexpr double kWidth = 0.3;  // rad; a pixel of the fine grid is 0.031
  const auto peak = [&](const Direction& centre) {
    const Layer made = reduced(picture(kFine, centre, kWidth), kCoarse, kWorkers);
    float most = 0;
    for (int y = 0; y < kCoarse.height; ++y) {
      for (int x = 0; x < kCoarse.width; ++x) most = std::max(most, made.at(x, y)[0]);
    }
    return static_cast<double>(most);
  };
  const double equator = peak({0, 0, 1});
  EXPECT_NEAR(peak({0, 0, -1}), equator, 0.01) << "at 180 degrees";
  for (const double latitude : {30.0, 60.0, 75.0, 90.0, -60.0, -90.0}) {
    const double phi = latitude / 180 * kPi;
    EXPECT_NEAR(peak({0, std::sin(phi), std::cos(phi)}), equator, 0.02) << latitude;
  }
}

TEST(Pyramid, AroundAPole_EveryMeridianIsTheSame) {
  const Layer made = reduced(picture(kFine, {0, 1, 0}, 0.2), kCoarse, kWorkers);
  for (int y = 0; y < kCoarse.height; ++y) {
    for (int x = 1; x < kCoarse.width; ++x) ASSERT_NEAR(made.at(x, y)[0], made.at(0, y)[0], 1e-4) << x << ", " << y;
  }
}

TEST(Pyramid, AWindow_IsReducedAsTheWholeSphere) {
  for (const Window& window :
       {Window{30, 40, 40, 20}, Window{180, 40, 40, 20}, Window{10, 2, 30, 30}, Window{190, 80, 20, 21}}) {
    Layer part(kFine, window, 1), whole(kFine, Window::all(kFine), 1);
    for (int j = 0; j < window.height; ++j) {
      for (int i = 0; i < window.width; ++i) {
        const auto value = static_cast<float>(1 + i * 7 % 5 + j * 3 % 4);
        part.at(i, j)[0] = value;
        whole.at((window.x + i) % kFine.width, window.y + j)[0] = value;
      }
    }
    const Layer a = reduced(part, kCoarse, kWorkers), b = reduced(whole, kCoarse, kWorkers);
    for (int y = 0; y < kCoarse.height; ++y) {
      for (int x = 0; x < kCoarse.width; ++x) {
        const float* found = a.find(x, y);
        ASSERT_NEAR(found == nullptr ? 0 : *found, *b.at(x, y), 1e-4) << window.x << ": " << x << ", " << y;
      }
    }
  }
}

TEST(Pyramid, AConstant_StaysOneInBothDirections) {
  Layer one(kFine, Window::all(kFine), 1);
  for (int y = 0; y < kFine.height; ++y) {
    for (int x = 0; x < kFine.width; ++x) *one.at(x, y) = 7;
  }
  const Layer coarse = reduced(one, kCoarse, kWorkers);
  std::vector<float> row;
  for (int y = 0; y < kFine.height; ++y) {
    Expansion(coarse, kFine).row(y, 150, 100, row);
    for (const float value : row) ASSERT_NEAR(value, 7, 1e-4) << y;
  }
}

TEST(Pyramid, ExpandedAndSampled_ASmoothPictureIsItself) {
  const Direction centre{0.3, -0.9, -0.316};
  const Layer coarse = picture(kCoarse, centre, 0.5);
  std::vector<float> row;
  for (int y = 0; y < kFine.height; ++y) {
    Expansion(coarse, kFine).row(y, 0, kFine.width, row);
    for (int x = 0; x < kFine.width; ++x) {
      const double truth = bump(direction(kFine, x + 0.5, y + 0.5), centre, 0.5);
      ASSERT_NEAR(row[static_cast<std::size_t>(x)], truth, 0.01) << x << ", " << y;
      float sampled = 0;
      sample_cubic(coarse, (x + 0.5) / 2, (y + 0.5) * 51 / 101, &sampled);
      ASSERT_NEAR(sampled, truth, 0.002) << x << ", " << y;
    }
  }
}

TEST(Pyramid, Grids_EndAtAbout32Columns) {
  const std::vector<Grid> grids = grids_below({1000, 500});
  ASSERT_EQ(grids.size(), 5U);
  EXPECT_EQ(grids[1], (Grid{500, 250}));
  EXPECT_EQ(grids[4], (Grid{63, 32}));
  EXPECT_EQ(grids_below({16, 8}).size(), 1U);
}

}  // namespace
}  // namespace nodal::bands
