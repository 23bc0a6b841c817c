#include "stitch/registration/pairs.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <tuple>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/registration/descent.h"
#include "stitch/registration/pair_errors.h"
#include "stitch/registration/pair_start.h"
#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/robust.h"

namespace nodal::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kMaxRounds = 60;
constexpr double kEnough = 1e-14;                         // share of the cost; a smaller decrease ends the descent
constexpr double kDamping = 1e-9;                         // the start is close, so steps are nearly Gauss-Newton steps
constexpr double kMinOutlier = 0.05 / kDegreesPerRadian;  // pairs set by hand are not more accurate than this
// Relative error of a prior's focal length; determines focal lengths that the pairs do not.
constexpr double kFocalSigma = 0.05;
constexpr double kMaxRms = 2 / kDegreesPerRadian;

/// The estimated parameters of the heads.
struct Stand {
  std::vector<Matrix3d> R_head_rig;
  std::vector<double> log_focal;  ///< change of the prior's
};

// One adjustment.
class Bundle {
 public:
  Bundle(const Calibration& prior, const std::vector<PointPair>& pairs, bool focals)
      : prior_(prior), pairs_(pairs), focals_(focals), used_(pairs.size(), true) {}

  Result<PairFit> run();

 private:
  Status start();
  Status adjust();
  Result<Lenses> lenses_of(const Stand& stand) const { return make_lenses(prior_, stand.log_focal, focals_); }
  bool joined(const PointPair& pair) const { return placed_[pair.head_a] && placed_[pair.head_b]; }
  Result<std::vector<double>> errors(const Stand& stand) const;
  double scale_of(std::vector<double> errors) const;
  bool add_end(const Stand& stand, const Lenses& lenses, const PairEnd& from, const PairEnd& to, double weight,
               solve::NormalEquations& sum) const;
  Status reweigh(const Stand& stand);
  solve::Evaluation evaluate(const Stand& stand) const;
  Stand moved(const Stand& from, const Eigen::VectorXd& step) const;
  int column_of(std::size_t head) const { return columns_[head]; }
  Status add_agreements(PairFit& fit) const;
  Result<PairFit> fit() const;

  const Calibration& prior_;
  const std::vector<PointPair>& pairs_;
  bool focals_;
  Stand stand_;
  std::vector<std::array<PairEnd, 2>> ends_;  // those of the pairs
  std::vector<bool> placed_, used_;
  std::vector<double> weights_;  // one per pair
  std::vector<int> columns_;     // column of each head's turn; its focal length follows; -1: fixed
  int first_ = 0;
  int count_ = 0;
  Eigen::MatrixXd H_;
  double noise_ = 0;  // rad, a pair
};

Status Bundle::start() {
  std::vector<Matrix3d>& R = stand_.R_head_rig;
  for (const HeadCalibration& head : prior_.heads) R.push_back(geometry::matrix_of(head.R_head_rig));
  stand_.log_focal.assign(R.size(), 0.0);
  NODAL_TRY_ASSIGN(const Lenses lenses, lenses_of(stand_));
  std::vector<RayPair> rays;
  first_ = -1;
  for (const PointPair& pair : pairs_) {
    if (std::max(pair.head_a, pair.head_b) >= prior_.heads.size() || pair.head_a == pair.head_b) {
      return fail(Errc::kBadValue, "a point pair must join two different heads of the calibration");
    }
    ends_.push_back({PairEnd{pair.head_a, pair.pixel_a, 0}, PairEnd{pair.head_b, pair.pixel_b, 0}});
    std::array<Vector3d, 2> of_ends;
    for (std::size_t k = 0; k < 2; ++k) {
      PairEnd& end = ends_.back()[k];
      const std::optional<geometry::Ray> ray = lenses[end.head].at.unproject(end.pixel);
      if (!ray) {
        return fail(Errc::kBadValue,
                    fmt::format("head '{}': its lens does not reach the point ({:f}, {:f}); take the point out, or "
                                "check the lens",
                                prior_.heads[end.head].name, end.pixel.x, end.pixel.y));
      }
      of_ends[k] = ray->direction();
      end.pixels_per_radian = std::sqrt(lenses[end.head].at.density(end.pixel));
    }
    const std::size_t low = pair.head_a < pair.head_b ? 0 : 1;
    rays.push_back({ends_.back()[low].head, ends_.back()[1 - low].head, of_ends[low], of_ends[1 - low]});
  }
  // The largest group of connected heads is placed; its first head keeps its rotation.
  std::vector<std::optional<Matrix3d>> found;
  std::ptrdiff_t most = 1;
  for (PairStart& island : islands_from_pairs(R, rays)) {
    const auto heads = std::ranges::count_if(island.R_head_rig, [](const auto& pose) { return pose.has_value(); });
    if (heads <= most) continue;
    most = heads;
    found = std::move(island.R_head_rig);
    first_ = static_cast<int>(island.first);
  }
  if (first_ < 0) {
    return fail(Errc::kNoCoverage,
                "the point pairs connect no two heads; give at least two pairs, some degrees apart, for "
                "two heads that overlap, and check that they belong to these heads");
  }
  for (std::size_t h = 0; h < R.size(); ++h) {
    placed_.push_back(found[h].has_value());
    if (found[h]) R[h] = *found[h];
    const bool moves = placed_.back() && static_cast<int>(h) != first_;
    columns_.push_back(placed_.back() ? count_ : -1);
    count_ += (moves ? 3 : 0) + (placed_.back() && focals_ ? 1 : 0);
  }
  for (std::size_t p = 0; p < pairs_.size(); ++p) used_[p] = joined(pairs_[p]);
  return {};
}

// Infinite for a point that the other head's lens does not reach.
Result<std::vector<double>> Bundle::errors(const Stand& stand) const {
  NODAL_TRY_ASSIGN(const Lenses lenses, lenses_of(stand));
  std::vector<double> all;
  for (const auto& [a, b] : ends_) {
    const std::optional<SeenEnd> in_a = seen_in(stand.R_head_rig, lenses, b, a),
                                 in_b = seen_in(stand.R_head_rig, lenses, a, b);
    all.push_back(in_a && in_b ? std::sqrt((in_a->error.squaredNorm() + in_b->error.squaredNorm()) / 2)
                               : std::numeric_limits<double>::infinity());
  }
  return all;
}

// A robust standard deviation of the errors of pairs between placed heads.
double Bundle::scale_of(std::vector<double> errors) const {
  std::vector<double> joined_ones;
  for (std::size_t p = 0; p < errors.size(); ++p) {
    if (joined(pairs_[p])) joined_ones.push_back(errors[p]);
  }
  constexpr double kSigmaPerMedianOfTwo = 1.2;  // an error has two directions: Rayleigh's median is 1.177 sigma
  return std::max(kSigmaPerMedianOfTwo * solve::median(joined_ones), 1e-9);
}

// Adds the error of a pair in the picture of its head `to`.
bool Bundle::add_end(const Stand& stand, const Lenses& lenses, const PairEnd& from, const PairEnd& to, double weight,
                     solve::NormalEquations& sum) const {
  const std::optional<SeenEnd> seen = seen_in(stand.R_head_rig, lenses, from, to);
  if (!seen) return false;
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> J =
      Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>::Zero(2, count_);
  const auto put = [&](std::size_t head, const Eigen::Matrix<double, 2, 3>& by_turn, const Eigen::Vector2d& by_focal) {
    int column = column_of(head);
    if (static_cast<int>(head) != first_) {
      J.block<2, 3>(0, column) = by_turn;
      column += 3;
    }
    if (focals_) J.col(column) = by_focal;
  };
  put(from.head, seen->by_turn_from, seen->by_focal_from);
  put(to.head, seen->by_turn_to, seen->by_focal_to);
  for (Eigen::Index k = 0; k < 2; ++k) sum.add(J.row(k).data(), seen->error[k], weight);
  return true;
}

// Finds the outliers for the current rotations, and the weights of the other pairs.
Status Bundle::reweigh(const Stand& stand) {
  NODAL_TRY_ASSIGN(const std::vector<double> all, errors(stand));
  noise_ = scale_of(all);
  const solve::Huber huber{2 * noise_};
  weights_.clear();
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    used_[p] = joined(pairs_[p]) && all[p] < std::max(5 * noise_, kMinOutlier);
    weights_.push_back(used_[p] ? huber.weight(all[p]) : 0);
  }
  return {};
}

solve::Evaluation Bundle::evaluate(const Stand& stand) const {
  solve::Evaluation sum{solve::NormalEquations(count_)};
  const Result<Lenses> lenses = lenses_of(stand);
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    if (!used_[p]) continue;
    const auto& [a, b] = ends_[p];
    // The two errors of a pair are of the same noise, so each has half of its weight.
    const double half = weights_[p] / 2;
    if (!lenses || !add_end(stand, *lenses, a, b, half, sum.equations) ||
        !add_end(stand, *lenses, b, a, half, sum.equations)) {
      sum.cost = solve::kImpossible;
      return sum;
    }
  }
  for (std::size_t h = 0; h < placed_.size() && focals_; ++h) {
    if (!placed_[h]) continue;
    const Eigen::Index column = column_of(h) + (static_cast<int>(h) == first_ ? 0 : 3);
    const double one = 1;
    sum.equations.add(std::span(&column, 1), std::span(&one, 1), stand.log_focal[h], std::pow(noise_ / kFocalSigma, 2));
  }
  sum.cost = sum.equations.cost();
  return sum;
}

Stand Bundle::moved(const Stand& from, const Eigen::VectorXd& step) const {
  Stand stand = from;
  for (std::size_t h = 0; h < placed_.size(); ++h) {
    if (!placed_[h]) continue;
    int column = column_of(h);
    if (static_cast<int>(h) != first_) {
      stand.R_head_rig[h] = geometry::rotation_about(step.segment<3>(column)) * stand.R_head_rig[h];
      column += 3;
    }
    if (focals_) stand.log_focal[h] += std::clamp(step[column], -0.1, 0.1);
  }
  return stand;
}

Status Bundle::adjust() {
  Status weighed;
  auto end = solve::descend_reweighted(
      stand_, [this](const Stand& stand) { return evaluate(stand); },
      [this](const Stand& from, const Eigen::VectorXd& step) { return moved(from, step); },
      [&](const Stand& stand) { weighed = reweigh(stand); },
      {.most_steps = kMaxRounds, .enough = kEnough, .first_damping = kDamping, .least_damping = kDamping});
  if (!weighed) return weighed;
  stand_ = std::move(end.state);
  H_ = end.at.equations.matrix();
  return {};
}

Status Bundle::add_agreements(PairFit& fit) const {
  NODAL_TRY_ASSIGN(const std::vector<double> all, errors(stand_));
  std::map<std::pair<std::size_t, std::size_t>, PairAgreement> agreements;
  double squares = 0, count = 0;
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const auto heads = std::minmax(pairs_[p].head_a, pairs_[p].head_b);
    PairAgreement& agreement = agreements[heads];
    std::tie(agreement.a, agreement.b) = heads;
    agreement.rejected += used_[p] ? 0 : 1;
    if (!used_[p]) continue;
    const double degrees = all[p] * kDegreesPerRadian;
    ++agreement.used;
    agreement.rms_deg += degrees * degrees;
    agreement.worst_deg = std::max(agreement.worst_deg, degrees);
    squares += degrees * degrees;
    ++count;
  }
  for (auto& [heads, agreement] : agreements) {
    if (agreement.used > 0) agreement.rms_deg = std::sqrt(agreement.rms_deg / agreement.used);
    fit.agreements.push_back(agreement);
  }
  fit.rms_deg = count > 0 ? std::sqrt(squares / count) : 0;
  return {};
}

Result<PairFit> Bundle::fit() const {
  PairFit fit;
  fit.calibration = prior_;
  fit.used = used_;
  // A pair's error has two directions.
  const Eigen::MatrixXd covariance = symmetric_system(H_).inverse() * (noise_ * noise_ / 2);
  for (std::size_t h = 0; h < placed_.size(); ++h) {
    HeadReport head;
    head.name = prior_.heads[h].name;
    head.placed = placed_[h];
    if (!placed_[h]) {
      head.why_not = "no two point pairs connect it to the others";
      head.sigma_deg = std::numeric_limits<double>::infinity();
      fit.warnings.push_back("head '" + head.name + "' is not placed: " + head.why_not);
      fit.heads.push_back(head);
      continue;
    }
    const Matrix3d prior = geometry::matrix_of(prior_.heads[h].R_head_rig);
    head.turned_deg = Eigen::AngleAxisd(Matrix3d(stand_.R_head_rig[h] * prior.transpose())).angle() * kDegreesPerRadian;
    int column = column_of(h);
    if (static_cast<int>(h) != first_) {
      const Matrix3d own = covariance.block<3, 3>(column, column);
      head.sigma_deg =
          std::sqrt(Eigen::SelfAdjointEigenSolver<Matrix3d>(own).eigenvalues().maxCoeff()) * kDegreesPerRadian;
      column += 3;
    }
    HeadCalibration& found = fit.calibration.heads[h];
    found.R_head_rig = geometry::rows_of(stand_.R_head_rig[h]);
    if (focals_) {
      found.lens = changed_lens(found.lens, stand_.log_focal[h], {}, 1, 1);
      head.focal_change_percent = 100 * std::expm1(stand_.log_focal[h]);
      head.sigma_focal_percent = 100 * std::sqrt(covariance(column, column));
    }
    fit.heads.push_back(head);
  }
  NODAL_TRY(add_agreements(fit));
  return fit;
}

Result<PairFit> Bundle::run() {
  NODAL_TRY(start());
  NODAL_TRY(adjust());
  NODAL_TRY_ASSIGN(PairFit found, fit());
  const auto used = std::ranges::count(used_, true);
  const auto joined_ones = std::ranges::count_if(pairs_, [&](const PointPair& pair) { return joined(pair); });
  if (noise_ > kMaxRms || 2 * used < joined_ones) {
    return fail(Errc::kHeadMismatch,
                "most point pairs contradict each other; check that they belong to these heads, in "
                "the calibration's order, and that the lenses are right");
  }
  NODAL_TRY(check_calibration(found.calibration));
  return found;
}

}  // namespace

Result<PairFit> fit_to_pairs(const Calibration& prior, const std::vector<PointPair>& pairs, Free free) {
  return Bundle(prior, pairs, free != Free::kRotations).run();
}

}  // namespace nodal::registration
