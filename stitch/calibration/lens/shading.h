// A model of how photographs show the pattern's light (uneven light, fall-off, response, exposure), separate from
// geometry so that these effects do not bias the lens.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace nodal::calibration {

/// A pixel's position in -1..1, the pattern's light there (0..1), and the photograph's value.
struct ShadeSample {
  float x = 0, y = 0, light = 0, value = 0;
};

/// Each photograph shows light p at (x, y) as a(x, y) tone(p) + b(x, y): a of degree 4 and b of degree 2 are
/// its own, the tone curve (from 0 to 1, straight between 17 knots) is common to all.
///
/// Threading: reads are thread-safe; fit() is not.
class Shadings {
 public:
  explicit Shadings(std::size_t views);

  /// Least squares without outliers. samples[v] are photograph v's.
  void fit(const std::vector<std::vector<ShadeSample>>& samples);

  struct Shown {
    double value;  ///< the photograph's expected value
    double slope;  ///< d value / d light
  };
  Shown at(std::size_t view, double x, double y, double light) const;
  /// The standard deviation of a photograph's residuals, estimated from their median.
  double scatter(std::size_t view) const { return scatter_[view]; }

 private:
  static constexpr int kDegree = 4, kTermsA = 15, kTermsB = 6, kKnots = 17;
  using Terms = Eigen::Matrix<double, kTermsA, 1>;
  struct Shading {
    Terms a = Terms::Unit(0);
    Eigen::Matrix<double, kTermsB, 1> b = Eigen::Matrix<double, kTermsB, 1>::Zero();
  };
  struct ToneSums;
  double tone(double light) const;
  double left_over(std::size_t view, const ShadeSample& sample, const Terms& terms) const;
  void fit_one(std::size_t view, const std::vector<ShadeSample>& samples);
  void add_tone(std::size_t view, const std::vector<ShadeSample>& samples, ToneSums& sums);
  bool fit_tone(ToneSums& sums);

  std::vector<Shading> shadings_;
  std::vector<double> scatter_;
  std::array<double, kKnots> tone_{};
  bool fitted_ = false;
};

}  // namespace nodal::calibration
