// A smooth function of the points of a square of pixels, by its values at nine of them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <utility>

namespace nodal::geometry {

/// The biquadratic polynomial through the values at the centres of nine pixels of a square of kSide x kSide: those in
/// its corners, in the middle of its sides and in its middle. N values a point; Side is even.
template <int N, int Side = 16>
struct Biquadratic {
  using Value = Eigen::Matrix<double, N, 1>;
  static constexpr int kSide = Side;
  /// Columns and rows of the nine pixels.
  static constexpr std::array<double, 3> kNodes{0, Side / 2, Side - 1};

  std::array<Value, 9> nodes;  ///< rows of three

  /// At (i, j) pixels from the centre of the square's first pixel.
  Value at(double i, double j) const {
    const Eigen::Vector3d across = weights(i), down = weights(j);
    Value sum = Value::Zero();
    for (int b = 0; b < 3; ++b) {
      for (int a = 0; a < 3; ++a) sum += across[a] * down[b] * nodes[static_cast<std::size_t>(3 * b + a)];
    }
    return sum;
  }

  /// Lagrange's polynomials for the three nodes.
  static Eigen::Vector3d weights(double t) {
    const auto [a, b, c] = kNodes;
    return {(t - b) * (t - c) / ((a - b) * (a - c)), (t - a) * (t - c) / ((b - a) * (b - c)),
            (t - a) * (t - b) / ((c - a) * (c - b))};
  }

  using Point = std::pair<double, double>;
  /// Two points where third derivatives show.
  static constexpr std::array kTwoChecks{Point(Side / 4.0, Side / 4.0), Point(Side * 0.75, Side * 3 / 16.0)};
  /// Four points; wherever an edge cuts off a corner, it shows at one of them by a quarter.
  static constexpr std::array kFourChecks{Point(Side * 3 / 16.0, Side * 3 / 16.0), Point(Side * 0.75, Side * 3 / 16.0),
                                          Point(Side * 3 / 16.0, Side * 0.75), Point(Side * 0.75, Side * 0.75)};

  /// The polynomial through `value(i, j)`, if it is within `tolerance` of it at further points, too. `value` returns an
  /// optional Value.
  template <class F>
  static std::optional<Biquadratic> fit(const F& value, double tolerance, std::span<const Point> checks = kTwoChecks) {
    Biquadratic made;
    for (int k = 0; k < 9; ++k) {
      const auto found = value(kNodes[static_cast<std::size_t>(k % 3)], kNodes[static_cast<std::size_t>(k / 3)]);
      if (!found) return std::nullopt;
      made.nodes[static_cast<std::size_t>(k)] = *found;
    }
    for (const auto& [i, j] : checks) {
      const auto found = value(i, j);
      if (!found || !((*found - made.at(i, j)).norm() < tolerance)) return std::nullopt;
    }
    return made;
  }
};

}  // namespace nodal::geometry
