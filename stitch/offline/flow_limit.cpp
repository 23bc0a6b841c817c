#include "stitch/offline/flow_limit.h"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace nodal::offline {
namespace {

/// Changes of the move are taken over twice so many px. A move may jump at the edge of a near object: only jumps that
/// tear or cover more than this are too large.
constexpr int kReach = 4;
/// The change of a picture's move per pixel, as a Frobenius norm: up to the first it is kept, from the second on it is
/// 0. A picture folds where its move changes by 1 a pixel or more.
constexpr float kKept = 1.0F, kFolded = 1.4F;
/// Growth per pixel of the distance from a fold, as a share of the longest flow: turns edges by 6 degrees.
constexpr float kGrowth = 0.1F;

/// What each pixel's flow moves the two pictures by.
struct Moves {
  std::array<Field, 2> of_a, of_b;  ///< across, down
};

/// The change per pixel of a picture's move around (x, y).
float change_at(const std::array<Field, 2>& move, int x, int y) {
  float sum = 0;
  for (const Field& part : move) {
    const float across = (part.row(y)[x + kReach] - part.row(y)[x - kReach]) / (2 * kReach);
    const float down = (part.row(y + kReach)[x] - part.row(y - kReach)[x]) / (2 * kReach);
    sum += across * across + down * down;
  }
  return std::sqrt(sum);
}

/// Lowers each pixel to what it may be beside its neighbours.
void grow_from_lowest(Field& longest) {
  constexpr float kDiagonal = std::numbers::sqrt2_v<float>;
  const auto beside = [&](int x, int y, int dx, int dy) {
    if (x + dx < 0 || x + dx >= longest.width || y + dy < 0 || y + dy >= longest.height) return;
    const float step = dx != 0 && dy != 0 ? kDiagonal : 1;
    longest.row(y)[x] = std::min(longest.row(y)[x], longest.row(y + dy)[x + dx] + step * kGrowth);
  };
  const auto sweep = [&](int x, int y, int way) {
    beside(x, y, -way, 0);
    for (int dx = -1; dx <= 1; ++dx) beside(x, y, dx, -way);
  };
  for (int y = 0; y < longest.height; ++y) {
    for (int x = 0; x < longest.width; ++x) sweep(x, y, 1);
  }
  for (int y = longest.height - 1; y >= 0; --y) {
    for (int x = longest.width - 1; x >= 0; --x) sweep(x, y, -1);
  }
}

}  // namespace

void limit_flow(const Field& known_a, const Field& known_b, const Field& share, Field& fx, Field& fy) {
  const int width = fx.width, height = fx.height;
  Moves moves;
  for (std::array<Field, 2>* move : {&moves.of_a, &moves.of_b}) move->fill(Field(width, height));
  for (std::size_t k = 0; k < fx.v.size(); ++k) {
    const float of_a = share.v[k], of_b = 1 - of_a;
    moves.of_a[0].v[k] = -of_b * fx.v[k];
    moves.of_a[1].v[k] = -of_b * fy.v[k];
    moves.of_b[0].v[k] = of_a * fx.v[k];
    moves.of_b[1].v[k] = of_a * fy.v[k];
  }
  const auto shows = [&](const Field& known, const std::array<Field, 2>& move, int x, int y) {
    const float u = static_cast<float>(x) + move[0].row(y)[x], v = static_cast<float>(y) + move[1].row(y)[x];
    const bool inside = u >= 0 && v >= 0 && u <= static_cast<float>(width - 1) && v <= static_cast<float>(height - 1);
    return inside && sample(known, place_of(width, height, u, v)) > 0.999F;
  };
  Field both(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      both.row(y)[x] = shows(known_a, moves.of_a, x, y) && shows(known_b, moves.of_b, x, y) ? 1 : 0;
  }
  Field longest(width, height);
  std::ranges::fill(longest.v, std::numeric_limits<float>::infinity());
  for (int y = kReach; y < height - kReach; ++y) {
    for (int x = kReach; x < width - kReach; ++x) {
      if (both.row(y)[x - kReach] + both.row(y)[x + kReach] + both.row(y - kReach)[x] + both.row(y + kReach)[x] < 4)
        continue;
      const float change = std::max(change_at(moves.of_a, x, y), change_at(moves.of_b, x, y));
      if (change <= kKept) continue;
      const float kept = std::max(0.0F, (kFolded - change) / (kFolded - kKept));
      longest.row(y)[x] = kept * std::hypot(fx.row(y)[x], fy.row(y)[x]);
    }
  }
  grow_from_lowest(longest);
  for (std::size_t k = 0; k < fx.v.size(); ++k) {
    const float length = std::hypot(fx.v[k], fy.v[k]);
    if (length <= longest.v[k]) continue;
    fx.v[k] *= longest.v[k] / length;
    fy.v[k] *= longest.v[k] / length;
  }
}

}  // namespace nodal::offline
