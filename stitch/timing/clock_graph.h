// The least-squares problem of film_times(): clocks of heads under lags between them.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "stitch/timing/film_times.h"

namespace nodal::timing {

/// Standard deviation of the error that a source has at one head, s: 10 cm of air for sound; differences of readout for
/// rotation; a few rows for a flash.
double error_at_head(Source source);

/// The solution of some of the lags.
///
/// Threading: immutable.
class ClockGraph {
 public:
  ClockGraph(int heads, int reference, std::span<const PairLag> lags, const std::vector<bool>& used);

  double offset(int head) const { return solution_[2 * head]; }
  double rate(int head) const { return solution_[2 * head + 1]; }
  /// Standard deviation of the reference's time at a head's time, s.
  double sigma(int head, double time) const;
  double rate_sigma(int head) const;

  /// A lag less what the solution says it is: value and rate.
  Eigen::Vector2d residual(const PairLag& lag) const;
  /// Covariance of what the solution says; `lag` is not one of those that were used.
  Eigen::Matrix2d covariance_of(const PairLag& lag) const;

 private:
  Eigen::VectorXd solution_;
  Eigen::MatrixXd covariance_;
};

/// The covariance of a lag's value and rate, with a floor under what is possible.
Eigen::Matrix2d covariance_of_measurement(const PairLag& lag);

/// How far a lag is from what the others say, in standard deviations squared (two degrees of freedom).
double contradiction(const PairLag& lag, const ClockGraph& others);

}  // namespace nodal::timing
