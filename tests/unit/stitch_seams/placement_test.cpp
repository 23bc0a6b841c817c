// Seams on small maps whose pictures differ in known places.
#include "stitch/seams/placement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace nodal::seams {
namespace {

using bands::Grid;
using bands::Layer;
using bands::Window;

constexpr Grid kMap{96, 48};
constexpr int kGrey = 0, kScore = 1;

std::size_t index(int x, int y) { return static_cast<std::size_t>(y * kMap.width + x); }

/// A head that sees columns x .. x + width - 1, best in their middle.
Layer view(int x, int width, const std::function<float(int, int)>& grey) {
  Layer made(kMap, {x, 0, width, kMap.height}, 2);
  for (int j = 0; j < kMap.height; ++j) {
    for (int i = 0; i < width; ++i) {
      made.at(i, j)[kGrey] = grey((x + i) % kMap.width, j);
      made.at(i, j)[kScore] = 1 - std::abs(2 * (static_cast<float>(i) + 0.5F) / static_cast<float>(width) - 1);
    }
  }
  return made;
}

float plain(int, int) { return 100; }

TEST(Placement, PicturesThatAgree_TheBestHeadShowsEveryPixel) {
  const std::vector<Layer> views{view(0, 72, plain), view(48, 72, plain)};
  const Labels labels = place_seams(views, {});
  int off = 0;
  for (int y = 0; y < kMap.height; ++y) {
    for (int x = 0; x < kMap.width; ++x) {
      const float* a = views[0].find(x, y);
      const float* b = views[1].find(x, y);
      const int best = (a == nullptr ? 0 : a[kScore]) >= (b == nullptr ? 0 : b[kScore]) ? 0 : 1;
      off += labels[index(x, y)] != best ? 1 : 0;
    }
  }
  EXPECT_LE(off, 4 * kMap.height) << "but for a column or two beside each of the two seams";
}

/// A disc that only the first head sees at its place, as one close to the rig.
bool in_disc(int x, int y) { return std::hypot(x - 60, y - 24) < 8; }

TEST(Placement, AnObjectThatOneHeadSeesElsewhere_IsNotCut) {
  const std::vector<Layer> views{view(0, 72, [](int x, int y) { return in_disc(x, y) ? 200.0F : 100.0F; }),
                                 view(48, 72, plain)};
  const Labels labels = place_seams(views, {});
  int first = 0, second = 0;
  for (int y = 0; y < kMap.height; ++y) {
    for (int x = 0; x < kMap.width; ++x) {
      if (!in_disc(x, y)) continue;
      (labels[index(x, y)] == 0 ? first : second) += 1;
    }
  }
  EXPECT_EQ(std::min(first, second), 0) << "the disc is shown by one head: " << first << ", " << second;
  EXPECT_LT(cost_of(views, labels),
            cost_of({views.data(), 2}, place_seams(std::vector<Layer>{view(0, 72, plain), views[1]}, {})))
      << "than seams that do not know of the disc";
}

TEST(Placement, AHeadThatSeesNoPixelOfARegion_NeverShowsIt) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> noise(0, 255);
  const auto speckled = [&](int, int) { return noise(random); };
  const std::vector<Layer> views{view(0, 40, speckled), view(30, 40, speckled), view(60, 30, speckled)};
  const Labels labels = place_seams(views, {});
  for (int y = 0; y < kMap.height; ++y) {
    for (int x = 0; x < kMap.width; ++x) {
      const std::uint8_t label = labels[index(x, y)];
      if (x >= 90) {
        EXPECT_EQ(label, kNobody) << x;
      } else {
        ASSERT_LT(label, 3);
        EXPECT_NE(views[label].find(x, y), nullptr) << x << ", " << y;
      }
    }
  }
}

TEST(Placement, NoLabelOfAnyPixelCouldBeBetter) {
  // A necessary condition of a minimum that shares nothing with the way it was found.
  std::mt19937 random(4);
  std::uniform_real_distribution<float> noise(0, 40);
  const auto speckled = [&](int, int) { return 100 + noise(random); };
  const std::vector<Layer> views{view(0, 60, speckled), view(30, 60, speckled), view(60, 60, speckled)};
  Labels labels = place_seams(views, {});
  const double cost = cost_of(views, labels);
  for (int k = 0; k < 400; ++k) {
    const int x = static_cast<int>(random() % kMap.width), y = static_cast<int>(random() % kMap.height);
    for (std::uint8_t other = 0; other < 3; ++other) {
      if (views[other].find(x, y) == nullptr) continue;
      const std::uint8_t before = std::exchange(labels[index(x, y)], other);
      EXPECT_GE(cost_of(views, labels), cost - 0.1) << x << ", " << y;
      labels[index(x, y)] = before;
    }
  }
}

// On a map that is large enough for a coarse start. Starting from the best head everywhere as the set before, without a
// cost of changes, places the seams anywhere on the whole map.
TEST(Placement, LargeMap_SeamsFromACoarseStartCostAsLittleAsThoseOfTheWholeMap) {
  constexpr Grid kLarge{512, 256};
  const auto wide = [&](int head, int x) {
    Layer made(kLarge, {x, 0, 320, kLarge.height}, 2);
    for (int j = 0; j < kLarge.height; ++j) {
      for (int i = 0; i < 320; ++i) {
        // What every head sees, and something else for each, in waves of some pixels.
        const double own = std::sin(0.11 * (i + x) * (head + 1)) * std::sin(0.07 * j * (head + 2));
        made.at(i, j)[kGrey] = static_cast<float>(120 + 60 * std::max(0.0, own));
        made.at(i, j)[kScore] = 1 - std::abs(2 * (static_cast<float>(i) + 0.5F) / 320 - 1);
      }
    }
    return made;
  };
  const std::vector<Layer> views{wide(0, 0), wide(1, 170), wide(2, 340)};
  PlacementOptions free;
  free.change = 0;
  Labels best(static_cast<std::size_t>(kLarge.width * kLarge.height), kNobody);
  for (int y = 0; y < kLarge.height; ++y) {
    for (int x = 0; x < kLarge.width; ++x) {
      float most = 0;
      for (std::size_t h = 0; h < views.size(); ++h) {
        const float* pixel = views[h].find(x, y);
        if (pixel == nullptr || pixel[kScore] <= most) continue;
        most = pixel[kScore];
        best[static_cast<std::size_t>(y * kLarge.width + x)] = static_cast<std::uint8_t>(h);
      }
    }
  }
  const double whole = cost_of(views, place_seams(views, best, free));
  const double start = cost_of(views, best);
  const double coarse = cost_of(views, place_seams(views, {}));
  EXPECT_LT(whole, 0.2 * start) << "or the test says nothing";
  EXPECT_LT(coarse, 1.06 * whole);
}

TEST(Placement, NoiseThatChanges_SeamsStay) {
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, 2);
  const auto noisy = [&](int x, int y) {
    return 100 + 40 * std::sin(0.7F * static_cast<float>(x + y)) + noise(random);
  };
  const auto changed = [](const Labels& a, const Labels& b) {
    int count = 0;
    for (std::size_t p = 0; p < a.size(); ++p) count += a[p] != b[p] ? 1 : 0;
    return count;
  };
  Labels before, before_afresh;
  int changes = 0, changes_afresh = 0;
  for (int set = 0; set < 10; ++set) {
    const std::vector<Layer> views{view(0, 72, noisy), view(48, 72, noisy)};
    const Labels labels = place_seams(views, before), afresh = place_seams(views, {});
    if (set > 0) {
      changes += changed(labels, before);
      changes_afresh += changed(afresh, before_afresh);
    }
    before = labels;
    before_afresh = afresh;
  }
  EXPECT_LE(changes, changes_afresh / 10) << "of " << changes_afresh << " without regard to the set before";
}

TEST(Placement, AnObjectWalksOntoASeam_TheSeamGoesAroundIt) {
  const std::vector<Layer> empty{view(0, 72, plain), view(48, 72, plain)};
  const Labels before = place_seams(empty, {});
  const std::vector<Layer> views{view(0, 72, [](int x, int y) { return in_disc(x, y) ? 200.0F : 100.0F; }),
                                 view(48, 72, plain)};
  const Labels after = place_seams(views, before);
  int first = 0, second = 0;
  for (int y = 0; y < kMap.height; ++y) {
    for (int x = 0; x < kMap.width; ++x) {
      if (in_disc(x, y)) (after[index(x, y)] == 0 ? first : second) += 1;
    }
  }
  EXPECT_EQ(std::min(first, second), 0);
  EXPECT_NE(before, after);
}

TEST(Shares, AtAStraightSeam_ChangeAtIt) {
  Labels labels(static_cast<std::size_t>(kMap.width * kMap.height), 0);
  for (int y = 0; y < kMap.height; ++y) {
    for (int x = 40; x < kMap.width; ++x) labels[index(x, y)] = 1;
  }
  std::vector<Share> shares;
  const auto first = [&](double u) {
    shares_at(labels, kMap, u, 20.3, shares);
    float sum = 0;
    for (const Share& share : shares) sum += share.part;
    EXPECT_NEAR(sum, 1, 1e-5);
    return int{shares.front().head};
  };
  EXPECT_EQ(first(39.9), 0);
  EXPECT_EQ(first(40.1), 1);
  EXPECT_EQ(first(95.9), 1);
  EXPECT_EQ(first(0.1), 0) << "across 180 degrees";
}

}  // namespace
}  // namespace nodal::seams
