#include "stitch/view/cell.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace nodal::view {
namespace {

using geometry::Biquadratic;
using geometry::Pixel;
using geometry::Ray;

constexpr double kSamePlace = 1.0 / 64;  // px of the raymap
/// Positions of a cell lie within so many px; more would need more samples a pixel than are taken.
constexpr double kWidest = 1.5 * Cell::kSide * Cell::kMaxSamples;

}  // namespace

int samples_for(double pixels) {
  return pixels * pixels < 1.6 ? 1 : std::clamp(static_cast<int>(pixels + 0.7), 1, Cell::kMaxSamples);
}

std::optional<Cell> Cell::make(const Target& target, const geometry::RaymapLayout& layout, const Pieces& pieces,
                               const Taps& taps, int left, int top) {
  if (!target.smooth || !layout.smooth() || left + kSide > target.width || top + kSide > target.height) {
    return std::nullopt;
  }
  std::optional<double> first;
  const auto position = [&](double i, double j) -> std::optional<Eigen::Vector2d> {
    const std::optional<Ray> ray = target.ray(left + 0.5 + i, top + 0.5 + j);
    const std::optional<Pixel> pixel = ray ? layout.pixel(*ray) : std::nullopt;
    if (!pixel) return std::nullopt;
    double x = pixel->x;
    if (!first) first = x;
    if (pieces.wraps()) x -= layout.width() * std::round((x - *first) / layout.width());
    if (!(std::abs(x - *first) < kWidest)) return std::nullopt;
    return Eigen::Vector2d(x, pixel->y);
  };
  const auto fitted = Biquadratic<2>::fit(position, kSamePlace);
  if (!fitted) return std::nullopt;
  Cell cell;
  cell.at_ = *fitted;
  cell.base_x_ = static_cast<std::int32_t>(std::floor(cell.at_.nodes[4].x()));
  cell.base_y_ = static_cast<std::int32_t>(std::floor(cell.at_.nodes[4].y()));
  for (auto& node : cell.at_.nodes) {
    node -= Eigen::Vector2d(cell.base_x_ + taps.shift(), cell.base_y_ + taps.shift());
  }
  if (taps.count > 1) {
    double across = 0, down = 0;
    const auto apart = [&](std::size_t a, std::size_t b, double pixels) {
      return (cell.at_.nodes[a] - cell.at_.nodes[b]).norm() / pixels;
    };
    for (std::size_t k = 0; k < 3; ++k) {
      across = std::max({across, apart(3 * k + 1, 3 * k, 8), apart(3 * k + 2, 3 * k + 1, 7)});
      down = std::max({down, apart(3 + k, k, 8), apart(6 + k, 3 + k, 7)});
    }
    cell.across_ = static_cast<std::uint8_t>(samples_for(across));
    cell.down_ = static_cast<std::uint8_t>(samples_for(down));
  }
  if (!cell.covers_one_piece(pieces, taps)) return std::nullopt;
  cell.expand();
  return cell;
}

bool Cell::covers_one_piece(const Pieces& pieces, const Taps& taps) {
  // Between rows of pixels positions go beyond those in the rows by an eighth of their second difference: by less than
  // a pixel, given kWidest.
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  for (int row = -1; row <= kSide; ++row) {
    const double j = std::clamp(row + 0.0, -0.5, kSide - 0.5);
    const Eigen::Array2d a = at_.at(-0.5, j), b = at_.at(0.5 * kSide - 0.5, j), c = at_.at(kSide - 0.5, j);
    low = low.min(a).min(b).min(c), high = high.max(a).max(b).max(c);
    for (int k = 0; k < 2; ++k) {
      const double slope = (c[k] - a[k]) / 2, bend = a[k] - 2 * b[k] + c[k];
      if (std::abs(bend) <= std::abs(slope)) continue;  // no extremum between the ends
      const double extreme = b[k] - slope * slope / (2 * bend);
      low[k] = std::min(low[k], extreme), high[k] = std::max(high[k], extreme);
    }
  }
  if (!((high - low).maxCoeff() < kWidest)) return false;
  const auto least = [&](double value) { return static_cast<int>(std::floor(value)) - 1 - taps.before; };
  const auto most = [&](double value) { return static_cast<int>(std::floor(value)) + 1 + taps.count - taps.before; };
  return pieces.all_joined(base_x_ + least(low[0]), base_y_ + least(low[1]), base_x_ + most(high[0]) + kLoadedBeyond,
                           base_y_ + most(high[1]));
}

void Cell::expand() {
  // Lagrange's polynomials by powers of their variable, from their values at -1, 0 and 1.
  static const Eigen::Matrix3d kPowers = [] {
    const Eigen::Vector3d before = Biquadratic<2>::weights(-1), at = Biquadratic<2>::weights(0),
                          behind = Biquadratic<2>::weights(1);
    Eigen::Matrix3d powers;
    powers.row(0) = at, powers.row(1) = (behind - before) / 2, powers.row(2) = (behind + before) / 2 - at;
    return powers;
  }();
  for (int k = 0; k < 2; ++k) {
    Eigen::Matrix3d nodes;  // by row and column
    for (int n = 0; n < 9; ++n) nodes(n / 3, n % 3) = at_.nodes[static_cast<std::size_t>(n)][k];
    powers_[static_cast<std::size_t>(k)] = kPowers * nodes.transpose() * kPowers.transpose();
  }
}

/// The positions of a row from (i, j) on, a pixel apart.
Curve Cell::curve(double i, double j) const {
  std::array<std::array<std::int32_t, 3>, 2> made;
  for (std::size_t k = 0; k < 2; ++k) {
    const Eigen::Matrix3d& c = powers_[k];
    const auto power = [&](Eigen::Index a) { return c(a, 0) + j * (c(a, 1) + j * c(a, 2)); };
    const double start = power(0), slope = power(1), bend = power(2);
    made[k] = {Curve::fixed(start + i * (slope + i * bend)), Curve::fixed(slope + (2 * i + 1) * bend),
               Curve::fixed(2 * bend)};
  }
  return {made[0][0], made[0][1], made[0][2], made[1][0], made[1][1], made[1][2]};
}

template <class Sample>
void Cell::write(const PlaneView& raymap, int channels, const Taps& taps, RowKernelOf<Sample> kernel, std::uint8_t* to,
                 std::ptrdiff_t stride) const {
  constexpr int kMax = Samples<Sample>::kMax;
  const std::uint8_t* origin = raymap.data + static_cast<std::ptrdiff_t>(base_y_) * raymap.row_stride +
                               static_cast<std::ptrdiff_t>(base_x_) * raymap.pixel_stride;
  std::array<typename Samples<Sample>::Scaled, 3 * kSide + 3> samples{};
  const int values = channels * kSide;
  std::array<Sample, 3 * kSide> pixels;
  for (int row = 0; row < kSide; ++row, to += stride) {
    if (across_ == 1 && down_ == 1) {
      kernel(origin, raymap.row_stride, taps, curve(0, row), kSide, samples.data());
      for (std::size_t k = 0; k < pixels.size(); ++k) {  // a constant number of them: eight or more at once
        pixels[k] = static_cast<Sample>(std::clamp((samples[k] + 32) >> 6, 0, kMax));
      }
      std::memcpy(to, pixels.data(), static_cast<std::size_t>(values) * sizeof(Sample));
      continue;
    }
    std::array<std::int32_t, 3 * kSide> sums{};
    for (int s = 0; s < across_ * down_; ++s) {
      const double di = (s % across_ + 0.5) / across_ - 0.5, dj = (s / across_ + 0.5) / down_ - 0.5;
      kernel(origin, raymap.row_stride, taps, curve(di, row + dj), kSide, samples.data());
      for (std::size_t k = 0; k < static_cast<std::size_t>(values); ++k) sums[k] += samples[k];
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(values); ++k) {
      store(mean_level<Sample>(sums[k], across_ * down_), to + k * sizeof(Sample));
    }
  }
}

template void Cell::write<std::uint8_t>(const PlaneView&, int, const Taps&, RowKernel, std::uint8_t*,
                                        std::ptrdiff_t) const;
template void Cell::write<std::uint16_t>(const PlaneView&, int, const Taps&, RowKernelOf<std::uint16_t>, std::uint8_t*,
                                         std::ptrdiff_t) const;

}  // namespace nodal::view
