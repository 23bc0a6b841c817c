#include "stitch/timing/clock_graph.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "stitch/solve/normal_equations.h"

namespace nodal::timing {
namespace {

// Before anything is measured: starts within a minute or so, and clocks as cameras have them.
constexpr double kOffsetSigma = 100, kRateSigma = 70e-6;
// No measurement is better than this, whatever its scatter.
constexpr double kMinLagSigma = 5e-6, kMinRateSigma = 0.02e-6;

/// The unknowns that a lag depends on: offset, rate and the source's error of both heads.
struct Dependence {
  std::array<Eigen::Index, 6> at{};
  Eigen::Matrix<double, 2, 6> slope{};
};

Dependence dependence_of(const PairLag& pair, Eigen::Index heads) {
  const Lag& lag = pair.lag;
  const auto error_of = [&](int head) { return heads * (2 + static_cast<int>(pair.source)) + head; };
  Dependence d;
  d.at = {2 * pair.a, 2 * pair.a + 1, error_of(pair.a), 2 * pair.b, 2 * pair.b + 1, error_of(pair.b)};
  // One instant at both heads: t + o_a + r_a t = t_b + o_b + r_b t_b, with t_b = t + lag(t); and its derivative by t.
  d.slope << 1, lag.at, 1, -1, -(lag.at + lag.lag), -1,  //
      0, 1, 0, 0, -(1 + lag.rate), 0;
  return d;
}

}  // namespace

double error_at_head(Source source) {
  switch (source) {
    case Source::kSound: return 0.3e-3;
    case Source::kRotation: return 0.5e-3;
    case Source::kFlash: return 0.2e-3;
  }
  return 1;
}

Eigen::Matrix2d covariance_of_measurement(const PairLag& pair) {
  Eigen::Matrix2d covariance;
  covariance << pair.lag.lag_variance, pair.lag.covariance, pair.lag.covariance, pair.lag.rate_variance;
  covariance(0, 0) += kMinLagSigma * kMinLagSigma;
  covariance(1, 1) += kMinRateSigma * kMinRateSigma;
  return covariance;
}

ClockGraph::ClockGraph(int heads, int reference, std::span<const PairLag> lags, const std::vector<bool>& used) {
  const int unknowns = heads * (2 + kSources);
  solve::NormalEquations equations(unknowns);
  const auto prior = [&](Eigen::Index at, double sigma) {
    const double slope = 1;
    equations.add(std::span(&at, 1), std::span(&slope, 1), 0, 1 / (sigma * sigma));
  };
  for (int head = 0; head < heads; ++head) {
    prior(2 * head, kOffsetSigma);
    prior(2 * head + 1, kRateSigma);
    for (int s = 0; s < kSources; ++s) prior(heads * (2 + s) + head, error_at_head(static_cast<Source>(s)));
  }
  for (std::size_t i = 0; i < lags.size(); ++i) {
    if (!used[i]) continue;
    const Dependence d = dependence_of(lags[i], heads);
    // Two independent rows: L^-1 of the covariance L L'.
    const Eigen::Matrix2d whiten =
        covariance_of_measurement(lags[i]).llt().matrixL().solve(Eigen::Matrix2d::Identity());
    const Eigen::Matrix<double, 2, 6> slope = whiten * d.slope;
    const Eigen::Vector2d value = whiten * Eigen::Vector2d(lags[i].lag.lag, lags[i].lag.rate);
    for (int row = 0; row < 2; ++row) {
      std::array<double, 6> by{};
      for (std::size_t k = 0; k < 6; ++k) by[k] = slope(row, static_cast<Eigen::Index>(k));
      equations.add(d.at, by, -value[row], 1);
    }
  }
  std::vector<bool> fixed(static_cast<std::size_t>(unknowns), false);
  fixed[static_cast<std::size_t>(2 * reference)] = fixed[static_cast<std::size_t>(2 * reference + 1)] = true;
  solution_ = equations.step(0, fixed);
  covariance_ = equations.covariance(fixed);
}

double ClockGraph::sigma(int head, double time) const {
  const Eigen::Vector2d slope(1, time);
  return std::sqrt(std::max(0.0, slope.dot(covariance_.block<2, 2>(2 * head, 2 * head) * slope)));
}

double ClockGraph::rate_sigma(int head) const {
  return std::sqrt(std::max(0.0, covariance_(2 * head + 1, 2 * head + 1)));
}

Eigen::Vector2d ClockGraph::residual(const PairLag& pair) const {
  const Dependence d = dependence_of(pair, solution_.size() / (2 + kSources));
  Eigen::Vector2d residual(pair.lag.lag, pair.lag.rate);
  for (std::size_t k = 0; k < 6; ++k) residual -= d.slope.col(static_cast<Eigen::Index>(k)) * solution_[d.at[k]];
  return residual;
}

Eigen::Matrix2d ClockGraph::covariance_of(const PairLag& pair) const {
  const Dependence d = dependence_of(pair, solution_.size() / (2 + kSources));
  Eigen::Matrix<double, 6, 6> part;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t k = 0; k < 6; ++k) {
      part(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = covariance_(d.at[i], d.at[k]);
    }
  }
  return d.slope * part * d.slope.transpose();
}

double contradiction(const PairLag& pair, const ClockGraph& others) {
  const Eigen::Vector2d residual = others.residual(pair);
  const Eigen::Matrix2d covariance = others.covariance_of(pair) + covariance_of_measurement(pair);
  return residual.dot(covariance.ldlt().solve(residual));
}

}  // namespace nodal::timing
