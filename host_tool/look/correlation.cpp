#include "host_tool/look/correlation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stitch/media/image_file.h"
#include "stitch/view/tangent.h"

namespace nodal::host::look {
namespace {

constexpr int kHalf = 8;           // samples on each side of the middle of what is compared
constexpr int kFineReach = 3;      // samples, on the levels after the coarsest
constexpr int kMaxReach = 16;      // samples, on the coarsest
constexpr int kBeside = 3;         // samples away, where the correlation must be lower
constexpr double kMinDrop = 0.04;  // by so much
constexpr std::size_t kMaxLevels = 7;
constexpr double kMinDeviation = 1;    // levels of 255: less is noise
constexpr double kSmallestLevel = 32;  // px, of the smallest picture

/// Values of a square of (2 * half + 1)^2 directions, row by row; NaN where the picture shows nothing.
struct Patch {
  int half = 0;
  std::vector<float> values;
  float at(int x, int y) const { return values[static_cast<std::size_t>((y + half) * (2 * half + 1) + x + half)]; }
};

/// Directions in a plane that touches the unit sphere.
struct Plane {
  Eigen::Vector3d middle, right, down;
  static Plane at(const Eigen::Vector3d& middle) {
    const Eigen::Vector3d other = std::abs(middle.y()) < 0.9 ? Eigen::Vector3d(0, 1, 0) : Eigen::Vector3d(1, 0, 0);
    const Eigen::Vector3d right = other.cross(middle).normalized();
    return {middle, right, middle.cross(right)};
  }
  geometry::Ray ray(double x, double y) const { return geometry::Ray::towards(middle + x * right + y * down); }
};

Patch sampled(const SeenBy& by, const Plane& plane, double step, int half, std::size_t level) {
  Patch patch{half, {}};
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x) {
      const std::optional<geometry::Pixel> pixel = by.head.pixel_of(plane.ray(x * step, y * step));
      const std::optional<float> value = pixel ? by.picture.at(*pixel, level) : std::nullopt;
      patch.values.push_back(value.value_or(std::nanf("")));
    }
  }
  return patch;
}

/// -1 where there is nothing to compare.
double correlation(const Patch& a, const Patch& b, int dx, int dy) {
  double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
  int n = 0;
  for (int y = -a.half; y <= a.half; ++y) {
    for (int x = -a.half; x <= a.half; ++x) {
      const double p = a.at(x, y), q = b.at(x + dx, y + dy);
      if (std::isnan(p) || std::isnan(q)) continue;
      ++n, sa += p, sb += q, saa += p * p, sbb += q * q, sab += p * q;
    }
  }
  const int whole = (2 * a.half + 1) * (2 * a.half + 1);
  if (2 * n < whole) return -1;
  const double va = saa / n - sa * sa / n / n, vb = sbb / n - sb * sb / n / n;
  if (va < kMinDeviation * kMinDeviation || vb < kMinDeviation * kMinDeviation) return -1;
  return (sab / n - sa * sb / n / n) / std::sqrt(va * vb);
}

struct Best {
  double x = 0, y = 0, value = -1;  // samples
  bool at_edge = false;
};

/// The largest correlation `away` samples from a place. On a straight edge it is nearly that of the place itself, which
/// is then uncertain along the edge.
double largest_beside(const Patch& wanted, const Patch& searched, const Best& best, int away) {
  const int bx = static_cast<int>(std::lround(best.x)), by = static_cast<int>(std::lround(best.y));
  double largest = -1;
  for (int k = -away; k <= away; ++k) {
    for (const auto& [x, y] : {std::pair{k, -away}, std::pair{k, away}, std::pair{-away, k}, std::pair{away, k}})
      largest = std::max(largest, correlation(wanted, searched, bx + x, by + y));
  }
  return largest;
}

/// The top of the parabola through three values at -1, 0 and 1.
double top(double before, double here, double after) {
  const double bend = before - 2 * here + after;
  return bend < 0 ? std::clamp((before - after) / 2 / bend, -0.5, 0.5) : 0;
}

Best best_of(const Patch& wanted, const Patch& searched, int reach) {
  Best best;
  int bx = 0, by = 0;
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      const double value = correlation(wanted, searched, x, y);
      if (value > best.value) best.value = value, bx = x, by = y;
    }
  }
  best.at_edge = std::abs(bx) == reach || std::abs(by) == reach;
  const auto beside = [&](int x, int y) { return correlation(wanted, searched, bx + x, by + y); };
  best.x = bx, best.y = by;
  if (best.value > -1 && !best.at_edge) {
    best.x += top(beside(-1, 0), best.value, beside(1, 0));
    best.y += top(beside(0, -1), best.value, beside(0, 1));
  }
  return best;
}

}  // namespace

GreyPyramid::GreyPyramid(const ImageView& picture) {
  const DecodedImage grey = media::convert_image(picture, PixelFormat::kGrey8);
  levels_.push_back({grey.width, grey.height, std::vector<float>(grey.bytes.begin(), grey.bytes.end())});
  while (levels_.size() < kMaxLevels && std::min(levels_.back().width, levels_.back().height) >= 2 * kSmallestLevel) {
    const Level& fine = levels_.back();
    Level half{fine.width / 2, fine.height / 2, {}};
    for (int y = 0; y < half.height; ++y) {
      for (int x = 0; x < half.width; ++x) {
        const float* const up = &fine.values[static_cast<std::size_t>(2 * y) * static_cast<std::size_t>(fine.width) +
                                             static_cast<std::size_t>(2 * x)];
        const float* const low = up + fine.width;
        half.values.push_back((up[0] + up[1] + low[0] + low[1]) / 4);
      }
    }
    levels_.push_back(std::move(half));
  }
}

std::optional<float> GreyPyramid::at(const geometry::Pixel& pixel, std::size_t level) const {
  const Level& of = levels_[level];
  const double scale = std::ldexp(1.0, -static_cast<int>(level));
  const double x = pixel.x * scale - 0.5, y = pixel.y * scale - 0.5;
  if (!(x >= 0 && y >= 0 && x < of.width - 1 && y < of.height - 1)) return std::nullopt;
  const auto column = static_cast<std::size_t>(x), row = static_cast<std::size_t>(y);
  const auto fx = static_cast<float>(x - std::floor(x)), fy = static_cast<float>(y - std::floor(y));
  const float* const up = &of.values[row * static_cast<std::size_t>(of.width) + column];
  const float* const low = up + of.width;
  return (up[0] * (1 - fx) + up[1] * fx) * (1 - fy) + (low[0] * (1 - fx) + low[1] * fx) * fy;
}

std::optional<Found> find_again(const SeenBy& from, const geometry::Pixel& pixel, const SeenBy& to,
                                const std::optional<geometry::Pixel>& near, double within_px) {
  if (!from.head.contains(pixel)) return std::nullopt;
  const std::optional<geometry::Ray> wanted = from.head.unproject(pixel);
  const std::optional<geometry::Ray> begin = near ? to.head.unproject(*near) : wanted;
  if (!wanted || !begin) return std::nullopt;
  const double density = from.head.density(pixel);  // px per steradian
  if (!(density > 0)) return std::nullopt;
  const double pixel_rad = 1 / std::sqrt(density);
  std::size_t level = 0;
  const std::size_t coarsest = std::min(from.picture.levels(), to.picture.levels()) - 1;
  while (level < coarsest && std::ldexp(within_px, -static_cast<int>(level)) > kMaxReach) ++level;
  int reach =
      std::clamp(static_cast<int>(std::ceil(std::ldexp(within_px, -static_cast<int>(level)))), kFineReach, kMaxReach);
  const Plane original = Plane::at(wanted->direction());
  Eigen::Vector3d now = begin->direction();
  Best best;
  double drop = 0;
  const auto look = [&](std::size_t on, int far) {
    const double step = std::ldexp(pixel_rad, static_cast<int>(on));
    // The plane of the other head's directions is that of the first one, carried along: no roll between them.
    Plane plane = Plane::at(now);
    plane.right = (original.right - original.right.dot(now) * now).normalized();
    plane.down = now.cross(plane.right);
    const Patch wanted_here = sampled(from, original, step, kHalf, on);
    const Patch searched = sampled(to, plane, step, kHalf + far + kBeside + 1, on);
    best = best_of(wanted_here, searched, far);
    if (on == 0) drop = best.value - largest_beside(wanted_here, searched, best, kBeside);
    if (best.value > -1) now = plane.ray(best.x * step, best.y * step).direction();
    return best.value > -1;
  };
  for (;; --level, reach = kFineReach) {
    if (!look(level, reach)) return std::nullopt;
    if (level == 0) break;
  }
  if (!look(0, 2) || drop < kMinDrop)
    return std::nullopt;  // once more from there, so that the parabola is about its top
  const std::optional<geometry::Pixel> place = to.head.pixel_of(geometry::Ray::towards(now));
  if (!place) return std::nullopt;
  return Found{*place, best.value};
}

}  // namespace nodal::host::look
