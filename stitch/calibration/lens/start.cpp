#include "stitch/calibration/lens/start.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "protocol/base/angles.h"
#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/robust.h"

namespace nodal::calibration {
namespace {

constexpr int kTries = 1500;
constexpr double kMinStartTilt = 5 * kRadiansPerDegree;
using Row6 = Eigen::Matrix<double, 1, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// A point relative to the lens's centre, with the aspect divided out.
Eigen::Vector2d from_center(const PointPair& pair, const Eigen::Vector2d& center, double aspect) {
  return {pair.photo.x() - center.x(), (pair.photo.y() - center.y()) / aspect};
}

/// A point's image is on the line from the centre towards (x, y), for every radial lens.
Row6 radial_row(const Eigen::Vector2d& p, const Eigen::Vector2d& X) {
  const Eigen::Vector3d h(X.x(), X.y(), 1);
  Row6 row;
  row << -p.y() * h.transpose(), p.x() * h.transpose();
  return row / std::max(p.norm(), 1e-9);
}

Eigen::Matrix<double, 2, 3> as_rows(const Vector6& m) {
  Eigen::Matrix<double, 2, 3> rows;
  rows << m.head<3>().transpose(), m.tail<3>().transpose();
  return rows;
}

/// The distance of a pair from that line, px; very large on the wrong side of the centre.
double radial_error(const Eigen::Matrix<double, 2, 3>& rows, const Eigen::Vector2d& p, const Eigen::Vector2d& X) {
  const Eigen::Vector2d q = (rows * Eigen::Vector3d(X.x(), X.y(), 1)).normalized();
  return p.dot(q) > 0 ? std::abs(p.x() * q.y() - p.y() * q.x()) : 1e9;
}

/// A deterministic sequence of random indices.
class Draw {
 public:
  std::size_t below(std::size_t n) {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<std::size_t>(state_ >> 33) % n;
  }

 private:
  std::uint64_t state_ = 1;
};

Vector6 null_vector(const Eigen::Matrix<double, Eigen::Dynamic, 6>& A) {
  const Eigen::Matrix<double, 6, 6> N = A.transpose() * A;
  return Eigen::JacobiSVD<Eigen::Matrix<double, 6, 6>>(N, Eigen::ComputeFullV).matrixV().col(5);
}

std::vector<std::size_t> inliers_of(const Eigen::Matrix<double, 2, 3>& rows, const std::vector<Eigen::Vector2d>& p,
                                    const std::vector<PointPair>& pairs, double tolerance_px) {
  std::vector<std::size_t> in;
  for (std::size_t i = 0; i < p.size(); ++i) {
    if (radial_error(rows, p[i], pairs[i].pattern) < tolerance_px) in.push_back(i);
  }
  return in;
}

/// A null vector has either sign; the right sign puts the points on their own side of the centre.
std::vector<std::size_t> best_sign(Vector6& m, const std::vector<Eigen::Vector2d>& p,
                                   const std::vector<PointPair>& pairs, double tolerance_px) {
  std::vector<std::size_t> plus = inliers_of(as_rows(m), p, pairs, tolerance_px);
  std::vector<std::size_t> minus = inliers_of(as_rows(-m), p, pairs, tolerance_px);
  if (minus.size() <= plus.size()) return plus;
  m = -m;
  return minus;
}

/// r31 and r32, up to a common sign, from two columns of a rotation whose first two rows are known up to a scale.
Eigen::Vector2d third_row(const Eigen::Matrix<double, 2, 3>& rows) {
  const double cross = rows.col(0).dot(rows.col(1));
  const double difference = rows.col(1).squaredNorm() - rows.col(0).squaredNorm();
  const double root = std::hypot(difference, 2 * cross);
  const double a = std::sqrt(std::max(0.0, (difference + root) / 2));
  const double b = std::sqrt(std::max(0.0, (root - difference) / 2));
  return {a, cross > 0 ? -b : b};
}

/// The distance and the lens's profile, both linear: r (z0 + t_z) = rho F(r), F(r) = a0 + a2 r^2 + a4 r^4, with r in
/// units of `unit` px.
struct Profile {
  Eigen::Vector3d F;
  std::vector<double> tz;
  double residual = 0;
};

Profile fit_profile(const std::vector<RadialPose>& views, const std::vector<double>& signs,
                    const Eigen::Vector2d& center, double aspect, double unit) {
  std::size_t count = 0;
  for (const RadialPose& view : views) count += view.inliers.size();
  const auto unknowns = static_cast<Eigen::Index>(3 + views.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(count), unknowns);
  Eigen::VectorXd b(static_cast<Eigen::Index>(count));
  Eigen::Index row = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (const PointPair& pair : views[v].inliers) {
      const double r = from_center(pair, center, aspect).norm() / unit;
      const double rho = (views[v].rows * pair.pattern.homogeneous()).norm();
      A.row(row).head<3>() << rho, rho * r * r, rho * r * r * r * r;
      A(row, 3 + static_cast<Eigen::Index>(v)) = -r;
      b(row) = r * signs[v] * views[v].third.dot(pair.pattern);
      ++row;
    }
  }
  const Eigen::VectorXd x = A.colPivHouseholderQr().solve(b);
  Profile profile;
  profile.F = x.head<3>();
  profile.tz.assign(x.data() + 3, x.data() + unknowns);
  profile.residual = (A * x - b).squaredNorm();
  return profile;
}

/// The lens of a kind that is nearest to the profile: tan(angle) = r / F(r).
LensParameters lens_of_profile(const Eigen::Vector3d& F, LensKind kind, const Eigen::Vector2d& center, double aspect,
                               double unit, double farthest_px) {
  LensParameters lens;
  lens.kind = kind;
  lens.count = parameter_count(kind);
  lens[kCenterX] = center.x();
  lens[kCenterY] = center.y();
  lens[kAspect] = aspect;
  const int n = lens.count - kFirstCoefficient;
  constexpr int kSamples = 64;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(kSamples, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(kSamples);
  for (int i = 0; i < kSamples; ++i) {
    const double r = (i + 0.5) / kSamples * farthest_px / unit;
    const double depth = F[0] + r * r * (F[1] + r * r * F[2]);
    const double angle = std::atan2(r, depth);
    if (kind == LensKind::kTsai) {
      if (depth <= 0.05 * F[0]) break;
      // f tan(a) = r + k1 r^3 + k2 r^5
      A.row(i) << std::tan(angle), -r * r * r, -r * r * r * r * r;
    } else {
      for (int k = 0; k < n; ++k) A(i, k) = std::pow(angle, lens.exponent(k));
    }
    b(i) = r;
  }
  const Eigen::VectorXd x = A.colPivHouseholderQr().solve(b);
  for (int k = 0; k < n; ++k) lens[kFirstCoefficient + k] = x(k) * unit;
  if (kind == LensKind::kTsai) {
    lens[kFirstCoefficient + 1] = x(1) / (unit * unit);
    lens[kFirstCoefficient + 2] = x(2) / (unit * unit * unit * unit);
  }
  return lens;
}

Pose pose_of(const RadialPose& view, double sign, double tz) {
  Eigen::Matrix3d R;
  R.col(0) << view.rows.col(0), sign * view.third.x();
  R.col(1) << view.rows.col(1), sign * view.third.y();
  R.col(2) = R.col(0).cross(R.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Pose pose;
  pose.R = svd.matrixU() * svd.matrixV().transpose();
  pose.t << view.rows.col(2), tz;
  return pose;
}

}  // namespace

double RadialPose::tilt() const { return std::asin(std::min(1.0, third.norm())); }

std::optional<RadialPose> radial_pose(const std::vector<PointPair>& pairs, const Eigen::Vector2d& center, double aspect,
                                      double tolerance_px) {
  if (pairs.size() < static_cast<std::size_t>(kMinPairs)) return std::nullopt;
  std::vector<Eigen::Vector2d> p;
  p.reserve(pairs.size());
  for (const PointPair& pair : pairs) p.push_back(from_center(pair, center, aspect));
  Draw draw;
  std::vector<std::size_t> best;
  for (int n = 0; n < kTries; ++n) {
    Eigen::Matrix<double, Eigen::Dynamic, 6> A(5, 6);
    for (Eigen::Index k = 0; k < 5; ++k) {
      const std::size_t i = draw.below(pairs.size());
      A.row(k) = radial_row(p[i], pairs[i].pattern);
    }
    Vector6 m = null_vector(A);
    std::vector<std::size_t> in = best_sign(m, p, pairs, tolerance_px);
    if (in.size() > best.size()) best = std::move(in);
  }
  Vector6 m = Vector6::Zero();
  for (int pass = 0; pass < 5 && best.size() >= static_cast<std::size_t>(kMinPairs); ++pass) {
    Eigen::Matrix<double, Eigen::Dynamic, 6> A(static_cast<Eigen::Index>(best.size()), 6);
    for (std::size_t k = 0; k < best.size(); ++k) {
      const std::size_t i = best[k];
      A.row(static_cast<Eigen::Index>(k)) = radial_row(p[i], pairs[i].pattern) * p[i].norm();
    }
    m = null_vector(A);
    best = best_sign(m, p, pairs, tolerance_px);
  }
  // Any pose fits some wrong pairs by chance; the pattern is found only if many more fit.
  if (best.size() < std::max<std::size_t>(kMinPairs, pairs.size() / 5)) return std::nullopt;
  RadialPose pose;
  pose.rows = as_rows(m);
  if (pose.rows.leftCols<2>().determinant() <= 0) return std::nullopt;  // a mirror image
  pose.third = third_row(pose.rows);
  const double scale = std::hypot(pose.rows.col(0).norm(), pose.third.x());
  pose.rows /= scale;
  pose.third /= scale;
  for (const std::size_t i : best) pose.inliers.push_back(pairs[i]);
  return pose;
}

Result<Arrangement> first_arrangement(const std::vector<RadialPose>& views, LensKind kind,
                                      const Eigen::Vector2d& center, double aspect) {
  double farthest = 0;
  double tilt = 0;
  for (const RadialPose& view : views) {
    tilt = std::max(tilt, view.tilt());
    for (const PointPair& pair : view.inliers) farthest = std::max(farthest, from_center(pair, center, aspect).norm());
  }
  if (tilt < kMinStartTilt) {
    return fail(Errc::kNotDetermined,
                "every photograph looks at the pattern head on, so that focal length and distance cannot be told "
                "apart; take some with the pattern turned by 20 to 40 degrees");
  }
  // Determines the signs one by one: first for the most tilted view, then for each other view consistently.
  std::vector<std::size_t> order(views.size());
  for (std::size_t v = 0; v < order.size(); ++v) order[v] = v;
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return views[a].tilt() > views[b].tilt(); });
  std::vector<double> signs(views.size(), 1.0);
  Profile profile;
  std::vector<RadialPose> taken;
  std::vector<double> taken_signs;
  for (const std::size_t v : order) {
    taken.push_back(views[v]);
    taken_signs.push_back(1);
    Profile plus = fit_profile(taken, taken_signs, center, aspect, farthest);
    taken_signs.back() = -1;
    Profile minus = fit_profile(taken, taken_signs, center, aspect, farthest);
    // The right sign makes the lens look forward along its axis.
    const bool plus_better = (plus.F[0] > 0) != (minus.F[0] > 0) ? plus.F[0] > 0 : plus.residual <= minus.residual;
    taken_signs.back() = plus_better ? 1 : -1;
    signs[v] = taken_signs.back();
    profile = plus_better ? plus : minus;
  }
  if (!(profile.F[0] > 0)) {
    return fail(Errc::kNotDetermined,
                "the photographs agree on no lens; check that they are all of one head with one focus and zoom");
  }
  Arrangement arrangement;
  arrangement.lens = lens_of_profile(profile.F, kind, center, aspect, farthest, farthest);
  arrangement.poses.resize(views.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    arrangement.poses[order[k]] = pose_of(views[order[k]], signs[order[k]], profile.tz[k]);
  }
  return arrangement;
}

namespace {

constexpr int kPoseUnknowns = 6;
constexpr double kLost = 100;  // px, for a pair that the lens or the plane does not reach

/// Adds one pair's two residuals, px; returns their length.
double add_pair(int view, const PointPair& pair, const SightFinder& lens, const PlaneFinder& plane,
                const solve::Huber& huber, solve::NormalEquations& sum) {
  const auto sight = lens.at({pair.photo.x(), pair.photo.y()});
  if (!sight) return kLost;
  const auto point = plane.at(sight->ray);
  if (!point) return kLost;
  const Eigen::Matrix2d to_px = (point->distance * point->by_move * sight->by_pixel).inverse();
  const Eigen::Vector2d residual = to_px * (point->at - pair.pattern);
  const Eigen::Matrix<double, 2, 3> by_move = to_px * point->by_move;
  const Eigen::Matrix<double, 2, kMaxLensParameters> by_lens = point->distance * by_move * sight->by_parameter;
  const double weight = huber.weight(residual.norm());
  for (int k = 0; k < 2; ++k) {
    const Eigen::Matrix<double, 1, kMaxLensParameters> by_shared = by_lens.row(k);
    const Eigen::Vector3d g = by_move.row(k);
    Eigen::Matrix<double, 1, kPoseUnknowns> by_own;
    by_own << g.cross(point->in_head).transpose(), -g.transpose();
    sum.add(view, by_shared.data(), by_own.data(), residual[k], weight);
  }
  return residual.norm();
}

solve::Evaluation evaluate_points(const Arrangement& arrangement, const std::vector<std::vector<PointPair>>& pairs,
                                  const solve::Huber& huber, std::vector<std::vector<double>>* errors) {
  const int views = static_cast<int>(pairs.size());
  solve::Evaluation evaluation{solve::NormalEquations(arrangement.lens.count, kPoseUnknowns, views)};
  const SightFinder lens(arrangement.lens);
  for (int v = 0; v < views; ++v) {
    const PlaneFinder plane(arrangement.poses[static_cast<std::size_t>(v)]);
    for (const PointPair& pair : pairs[static_cast<std::size_t>(v)]) {
      const double e = add_pair(v, pair, lens, plane, huber, evaluation.equations);
      evaluation.cost += huber.cost(e);
      if (errors != nullptr) (*errors)[static_cast<std::size_t>(v)].push_back(e);
    }
  }
  return evaluation;
}

}  // namespace

Arrangement moved(const Arrangement& arrangement, const Eigen::VectorXd& step, int own) {
  Arrangement next = arrangement;
  for (int k = 0; k < next.lens.count; ++k) next.lens[k] += step[k];
  for (std::size_t v = 0; v < next.poses.size(); ++v) {
    const auto at = next.lens.count + static_cast<Eigen::Index>(v) * own;
    next.poses[v] = next.poses[v].moved(step.segment<3>(at), step.segment<3>(at + 3));
  }
  return next;
}

double refine_on_points(std::vector<std::vector<PointPair>>& pairs, const std::vector<bool>& fixed_lens,
                        double huber_px, Arrangement& arrangement) {
  std::vector<bool> fixed = fixed_lens;
  fixed.resize(static_cast<std::size_t>(arrangement.lens.count) + kPoseUnknowns * pairs.size(), false);
  const solve::Huber huber{huber_px};
  arrangement = solve::descend(
                    arrangement, [&](const Arrangement& a) { return evaluate_points(a, pairs, huber, nullptr); },
                    [](const Arrangement& a, const Eigen::VectorXd& step) { return moved(a, step, kPoseUnknowns); },
                    fixed, {.most_steps = 60, .enough = 1e-6, .first_damping = 1e-3})
                    .state;
  std::vector<std::vector<double>> errors(pairs.size());
  (void)evaluate_points(arrangement, pairs, huber, &errors);
  std::vector<double> all;
  for (const auto& view : errors) all.insert(all.end(), view.begin(), view.end());
  const double median = solve::median(all);
  for (std::size_t v = 0; v < pairs.size(); ++v) {
    std::vector<PointPair> kept;
    for (std::size_t i = 0; i < pairs[v].size(); ++i) {
      if (errors[v][i] <= 5 * median + 0.5) kept.push_back(pairs[v][i]);
    }
    pairs[v] = std::move(kept);
  }
  return median;
}

solve::Evaluation evaluated_on_points(const Arrangement& arrangement, const std::vector<std::vector<PointPair>>& pairs,
                                      double huber_px) {
  return evaluate_points(arrangement, pairs, solve::Huber{huber_px}, nullptr);
}

}  // namespace nodal::calibration
