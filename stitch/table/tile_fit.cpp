#include "stitch/table/tile_fit.h"

#include <algorithm>

namespace nodal::table {
namespace {

constexpr double kMiddle = 3.5;  // centre of a tile; the terms are in u = i - 3.5, v = j - 3.5
/// Added to the diagonal, so that pixels in a single row or corner have a solution too.
constexpr double kRidge = 1e-3;

template <std::size_t kTerms>
using Terms = std::array<double, kTerms>;

/// 1, u, v, uv, and uu and vv minus their means over a tile.
template <std::size_t kTerms>
Terms<kTerms> terms_at(std::size_t pixel) {
  constexpr double kMean = 5.25;
  const double u = static_cast<double>(pixel % 8) - kMiddle;
  const double v = static_cast<double>(pixel / 8) - kMiddle;
  const std::array<double, 6> all{1, u, v, u * v, u * u - kMean, v * v - kMean};
  Terms<kTerms> terms;
  for (std::size_t k = 0; k < kTerms; ++k) terms[k] = all[k];
  return terms;
}

/// Solves the normal equations by elimination; they are positive definite, so no pivoting is needed.
template <std::size_t kTerms>
Terms<kTerms> solve(std::array<std::array<double, kTerms + 1>, kTerms>& a) {
  for (std::size_t k = 0; k < kTerms; ++k) {
    for (std::size_t r = k + 1; r < kTerms; ++r) {
      const double factor = a[r][k] / a[k][k];
      for (std::size_t c = k; c <= kTerms; ++c) a[r][c] -= factor * a[k][c];
    }
  }
  Terms<kTerms> x;
  for (std::size_t k = kTerms; k-- > 0;) {
    double rest = a[k][kTerms];
    for (std::size_t c = k + 1; c < kTerms; ++c) rest -= a[k][c] * x[c];
    x[k] = rest / a[k][k];
  }
  return x;
}

template <std::size_t kTerms>
Terms<kTerms> least_squares(const PixelValues& values, PixelMask mask) {
  if (mask == ~PixelMask{0}) {
    // Over a whole tile the terms are orthogonal.
    Terms<kTerms> across{};
    for (std::size_t p = 0; p < values.size(); ++p) {
      const Terms<kTerms> terms = terms_at<kTerms>(p);
      for (std::size_t k = 0; k < kTerms; ++k) across[k] += terms[k] * values[p];
    }
    constexpr std::array<double, 6> kSquares{64, 336, 336, 1764, 1344, 1344};
    for (std::size_t k = 0; k < kTerms; ++k) across[k] /= kSquares[k];
    return across;
  }
  std::array<std::array<double, kTerms + 1>, kTerms> normal{};
  for (std::size_t p = 0; p < values.size(); ++p) {
    if ((mask >> p & 1) == 0) continue;
    const Terms<kTerms> terms = terms_at<kTerms>(p);
    for (std::size_t r = 0; r < kTerms; ++r) {
      for (std::size_t c = 0; c < kTerms; ++c) normal[r][c] += terms[r] * terms[c];
      normal[r][kTerms] += terms[r] * values[p];
    }
  }
  for (std::size_t k = 0; k < kTerms; ++k) normal[k][k] += k == 0 ? kRidge * kRidge : kRidge;
  return solve<kTerms>(normal);
}

std::int32_t round(double value) {
  const double up = value + 0.5;
  const auto whole = static_cast<std::int32_t>(up);
  return whole - (up < whole ? 1 : 0);
}

/// Coefficients of 1, i, j, ij, ii, jj from those of the centred terms.
std::array<std::int32_t, 6> rounded(const std::array<double, 6>& fit) {
  const std::int32_t ij = round(fit[3]);
  const std::int32_t ii = round(fit[4]);
  const std::int32_t jj = round(fit[5]);
  const std::int32_t i = round(fit[1] - kMiddle * ij - 2 * kMiddle * ii);
  const std::int32_t j = round(fit[2] - kMiddle * ij - 2 * kMiddle * jj);
  // The mean of the rounded terms over the tile is subtracted from the constant; the mean of ii and of jj is 17.5.
  const double mean = kMiddle * i + kMiddle * j + kMiddle * kMiddle * ij + 17.5 * ii + 17.5 * jj;
  return {round(fit[0] - mean), i, j, ij, ii, jj};
}

}  // namespace

PixelMask block_mask(const Block& block) {
  PixelMask mask = 0;
  for (int j = block.top; j < block.bottom; ++j) {
    for (int i = block.left; i < block.right; ++i) mask |= pixel_bit(i, j);
  }
  return mask;
}

Span span_of(const PixelValues& values, PixelMask mask) {
  Span span;
  for_each(mask, [&](std::size_t p) {
    span.least = std::min(span.least, values[p]);
    span.most = std::max(span.most, values[p]);
  });
  return span;
}

std::array<std::int32_t, 6> fit_quadratic(const PixelValues& values, PixelMask mask) {
  return rounded(least_squares<6>(values, mask));
}

std::array<std::int32_t, 4> fit_bilinear(const PixelValues& values, PixelMask mask) {
  const Terms<4> fit = least_squares<4>(values, mask);
  const std::array<std::int32_t, 6> whole = rounded({fit[0], fit[1], fit[2], fit[3], 0, 0});
  return {whole[0], whole[1], whole[2], whole[3]};
}

}  // namespace nodal::table
