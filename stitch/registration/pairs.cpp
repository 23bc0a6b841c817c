#include "stitch/registration/pairs.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <tuple>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/registration/descent.h"
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
constexpr double kFocalStep = 1e-5;
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
  Result<Vector3d> ray(std::size_t head, geometry::Pixel pixel, double log_focal) const;
  Result<Vector3d> ray(const Stand& stand, std::size_t head, geometry::Pixel pixel) const {
    return ray(head, pixel, stand.log_focal[head]);
  }
  bool joined(const PointPair& pair) const { return placed_[pair.head_a] && placed_[pair.head_b]; }
  Result<std::vector<double>> errors(const Stand& stand) const;
  double scale_of(std::vector<double> errors) const;
  Status add_pair(const Stand& stand, const PointPair& pair, double weight, solve::NormalEquations& sum) const;
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
  std::vector<bool> placed_, used_;
  std::vector<double> weights_;  // one per pair
  std::vector<int> columns_;     // column of each head's turn; its focal length follows; -1: fixed
  int first_ = 0;
  int count_ = 0;
  Eigen::MatrixXd H_;
  double noise_ = 0;  // rad, a pair
};

Result<Vector3d> Bundle::ray(std::size_t head, geometry::Pixel pixel, double log_focal) const {
  HeadCalibration own = prior_.heads[head];
  own.R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  if (log_focal != 0) own.lens = changed_lens(own.lens, log_focal, {}, 1, 1);
  const Result<geometry::Lens> lens = geometry::Lens::make(own.lens, log_focal == 0 ? own.max_angle : 0);
  if (!lens) return fail(lens.error().in("head '" + own.name + "'"));
  const double x = pixel.x - own.center_x, y = (pixel.y - own.center_y) / own.aspect, r = std::hypot(x, y);
  const std::optional<double> angle = lens->angle(r);
  if (!angle) {
    return fail(
        Errc::kBadValue,
        fmt::format("head '{}': its lens does not reach the point ({:f}, {:f}); take the point out, or check the lens",
                    own.name, pixel.x, pixel.y));
  }
  const double s = r > 0 ? std::sin(*angle) / r : 0;
  return Vector3d(s * x, s * y, std::cos(*angle));
}

Status Bundle::start() {
  std::vector<RayPair> rays;
  first_ = -1;
  for (const PointPair& pair : pairs_) {
    if (std::max(pair.head_a, pair.head_b) >= prior_.heads.size() || pair.head_a == pair.head_b) {
      return fail(Errc::kBadValue, "a point pair must join two different heads of the calibration");
    }
    const PointPair way =
        pair.head_a < pair.head_b ? pair : PointPair{pair.head_b, pair.pixel_b, pair.head_a, pair.pixel_a};
    const Result<Vector3d> a = ray(way.head_a, way.pixel_a, 0), b = ray(way.head_b, way.pixel_b, 0);
    if (!a) return fail(a.error());
    if (!b) return fail(b.error());
    rays.push_back({way.head_a, way.head_b, *a, *b});
  }
  std::vector<Matrix3d>& R = stand_.R_head_rig;
  for (const HeadCalibration& head : prior_.heads) R.push_back(geometry::matrix_of(head.R_head_rig));
  stand_.log_focal.assign(R.size(), 0.0);
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

Result<std::vector<double>> Bundle::errors(const Stand& stand) const {
  std::vector<double> all;
  for (const PointPair& pair : pairs_) {
    const Result<Vector3d> a = ray(stand, pair.head_a, pair.pixel_a), b = ray(stand, pair.head_b, pair.pixel_b);
    if (!a) return fail(a.error());
    if (!b) return fail(b.error());
    const auto& R = stand.R_head_rig;
    all.push_back((R[pair.head_a].transpose() * *a - R[pair.head_b].transpose() * *b).norm());
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

Status Bundle::add_pair(const Stand& stand, const PointPair& pair, double weight, solve::NormalEquations& sum) const {
  using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
  Rows J = Rows::Zero(3, count_);
  Vector3d error = Vector3d::Zero();
  const auto add = [&](std::size_t head, geometry::Pixel pixel, double sign) -> Status {
    NODAL_TRY_ASSIGN(const Vector3d r, ray(stand, head, pixel));
    const Matrix3d back = stand.R_head_rig[head].transpose();
    error += sign * (back * r);
    int column = column_of(head);
    if (static_cast<int>(head) != first_) {
      // If the head turns by w, its ray r is at R^T (r - w x r) = R^T r + R^T (r x w) in the rig.
      Matrix3d cross;
      cross << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
      J.block<3, 3>(0, column) += sign * (back * cross);
      column += 3;
    }
    if (!focals_) return {};
    const Result<Vector3d> above = ray(head, pixel, stand.log_focal[head] + kFocalStep);
    const Result<Vector3d> below = ray(head, pixel, stand.log_focal[head] - kFocalStep);
    if (above && below) J.col(column) += sign * (back * (*above - *below)) / (2 * kFocalStep);
    return {};
  };
  NODAL_TRY(add(pair.head_a, pair.pixel_a, 1));
  NODAL_TRY(add(pair.head_b, pair.pixel_b, -1));
  for (Eigen::Index k = 0; k < 3; ++k) sum.add(J.row(k).data(), error[k], weight);
  return {};
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
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    if (used_[p] && !add_pair(stand, pairs_[p], weights_[p], sum.equations)) {
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
