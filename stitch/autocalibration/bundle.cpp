#include "stitch/autocalibration/bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "stitch/geometry/rotation.h"
#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/robust.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kLensUnknowns = 6;            // log focal, two coefficients, log aspect, the axis's shift
constexpr double kSlope = 1e-5;             // for derivatives by the lens
constexpr double kFarthest = 0.05;          // units; a match that is farther off is an outlier
constexpr double kNearest = 0.001;          // units; features are not more accurate than this
constexpr double kStatedFocalSigma = 0.1;   // of its logarithm: stated for infinity, and rounded to whole millimetres
constexpr double kAspectSigma = 0.01;       // of its logarithm, about the prior's
constexpr double kMostAspectChange = 0.05;  // of it
constexpr double kPixelsPerUnit = 1000;     // a lens's focal length must be at least one pixel
constexpr int kMostSteps = 60;
constexpr double kEnough = 1e-7;

SharedLens changed(const SharedLens& lens, int unknown, double by) {
  SharedLens other = lens;
  if (unknown == 0) other.model.focal *= std::exp(by);
  else if (unknown == 3) other.aspect *= std::exp(by);
  else if (unknown > 3) other.shift[unknown - 4] += by;
  else other.model.k[static_cast<std::size_t>(unknown - 1)] += by;
  return other;
}

class Bundle {
 public:
  Bundle(const BundleState& start, const std::vector<UnitMatch>& matches, const BundleRules& rules)
      : matches_(matches), rules_(rules) {
    int count = kLensUnknowns;
    for (std::size_t h = 0; h < start.R_head_rig.size(); ++h) {
      columns_.push_back(-1);
      if (!start.R_head_rig[h] || h == rules.first) continue;
      columns_.back() = count;
      count += 3;
    }
    fixed_.assign(static_cast<std::size_t>(count), false);
    fixed_[3] = !rules.free_aspect;
  }

  BundleFit run(BundleState start);

 private:
  bool joined(const BundleState& state, const UnitMatch& match) const {
    return state.R_head_rig[match.a] && state.R_head_rig[match.b];
  }
  std::vector<double> errors(const BundleState& state) const;
  void reweigh(const BundleState& state);
  solve::Evaluation evaluate(const BundleState& state) const;
  BundleState moved(const BundleState& from, const Eigen::VectorXd& step) const;

  const std::vector<UnitMatch>& matches_;
  BundleRules rules_;
  std::vector<int> columns_;  // of a head's turn; -1: fixed
  std::vector<bool> fixed_;
  std::vector<double> weights_;
  double noise_ = 0;
};

// The distance of a match's two rays, in units of radius near the lens's axis.
std::vector<double> Bundle::errors(const BundleState& state) const {
  std::vector<double> all(matches_.size(), std::numeric_limits<double>::infinity());
  const Result<LensRays> rays = LensRays::make(state.lens);
  if (!rays) return all;
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    const UnitMatch& match = matches_[m];
    if (!joined(state, match)) continue;
    const auto a = rays->ray(match.at_a), b = rays->ray(match.at_b);
    if (!a || !b) continue;
    all[m] = state.lens.model.focal *
             (state.R_head_rig[match.a]->transpose() * *a - state.R_head_rig[match.b]->transpose() * *b).norm();
  }
  return all;
}

void Bundle::reweigh(const BundleState& state) {
  const std::vector<double> all = errors(state);
  std::vector<double> near;
  for (const double error : all) {
    if (error < kFarthest) near.push_back(error);
  }
  noise_ = std::max(kNearest, 1.2 * solve::median(near));  // Rayleigh's median is 1.177 sigma
  const double limit = std::min(kFarthest, 5 * noise_);
  const solve::Huber huber{2 * noise_};
  weights_.clear();
  for (const double error : all) weights_.push_back(error < limit ? huber.weight(error) : 0);
}

solve::Evaluation Bundle::evaluate(const BundleState& state) const {
  const int count = static_cast<int>(fixed_.size());
  solve::Evaluation sum{solve::NormalEquations(count)};
  const auto impossible = [&] {
    sum.cost = solve::kImpossible;
    return sum;
  };
  const Result<LensRays> rays = LensRays::make(state.lens);
  if (!rays) return impossible();
  std::vector<std::array<LensRays, 2>> beside;
  for (int k = 0; k < kLensUnknowns; ++k) {
    const Result<LensRays> more = LensRays::make(changed(state.lens, k, kSlope));
    const Result<LensRays> less = LensRays::make(changed(state.lens, k, -kSlope));
    if (!more || !less) return impossible();
    beside.push_back({*more, *less});
  }
  using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
  Rows J(3, count);
  const double focal = state.lens.model.focal;
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    if (weights_[m] == 0) continue;
    const UnitMatch& match = matches_[m];
    J.setZero();
    Vector3d error = Vector3d::Zero();
    const auto add = [&](std::size_t head, const Eigen::Vector2d& at, double sign) {
      const auto ray = rays->ray(at);
      if (!ray) return false;
      const Matrix3d back = state.R_head_rig[head]->transpose();
      error += sign * (back * *ray);
      if (columns_[head] >= 0) {
        // If the head turns by w, its ray r is at R^T r + R^T (r x w) in the rig.
        Matrix3d cross;
        cross << 0, -ray->z(), ray->y(), ray->z(), 0, -ray->x(), -ray->y(), ray->x(), 0;
        J.block<3, 3>(0, columns_[head]) += sign * focal * (back * cross);
      }
      for (int k = 0; k < kLensUnknowns; ++k) {
        const auto more = beside[static_cast<std::size_t>(k)][0].ray(at),
                   less = beside[static_cast<std::size_t>(k)][1].ray(at);
        if (more && less) J.col(k) += sign * focal / (2 * kSlope) * (back * (*more - *less));
      }
      return true;
    };
    if (!add(match.a, match.at_a, 1) || !add(match.b, match.at_b, -1)) return impossible();
    error *= focal;
    J.col(0) += error;  // the unit of the error is the focal length
    for (Eigen::Index k = 0; k < 3; ++k) sum.equations.add(J.row(k).data(), error[k], weights_[m]);
  }
  const auto hold = [&](Eigen::Index unknown, double off, double sigma) {
    const double one = 1;
    sum.equations.add(std::span(&unknown, 1), std::span(&one, 1), off, std::pow(noise_ / sigma, 2));
  };
  if (rules_.stated_focal > 0) hold(0, std::log(state.lens.model.focal / rules_.stated_focal), kStatedFocalSigma);
  for (std::size_t k = 0; k < rules_.sigma.size(); ++k) {
    hold(static_cast<Eigen::Index>(k) + 1, state.lens.model.k[k] - rules_.prior.model.k[k], rules_.sigma[k]);
  }
  hold(3, std::log(state.lens.aspect / rules_.prior.aspect), kAspectSigma);
  for (int k = 0; k < 2; ++k) hold(4 + k, state.lens.shift[k], rules_.shift_sigma);
  sum.cost = sum.equations.cost();
  return sum;
}

BundleState Bundle::moved(const BundleState& from, const Eigen::VectorXd& step) const {
  BundleState state = from;
  for (int k = 0; k < kLensUnknowns; ++k) state.lens = changed(state.lens, k, std::clamp(step[k], -0.1, 0.1));
  const double most = std::exp(kMostAspectChange);
  state.lens.aspect = std::clamp(state.lens.aspect, rules_.prior.aspect / most, rules_.prior.aspect * most);
  for (std::size_t h = 0; h < columns_.size(); ++h) {
    if (columns_[h] < 0) continue;
    state.R_head_rig[h] = geometry::rotation_about(step.segment<3>(columns_[h])) * *from.R_head_rig[h];
  }
  return state;
}

BundleFit Bundle::run(BundleState start) {
  // ReweightedProblem has no fixed unknowns; each round holds its weights.
  BundleFit fit{std::move(start), {}, 0};
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    reweigh(fit.state);
    auto end = solve::descend(
        fit.state, [this](const BundleState& state) { return evaluate(state); },
        [this](const BundleState& from, const Eigen::VectorXd& step) { return moved(from, step); }, fixed_,
        {.most_steps = kMostSteps / kRounds, .enough = kEnough, .first_damping = 1e-6});
    fit.state = std::move(end.state);
  }
  reweigh(fit.state);
  const std::vector<double> all = errors(fit.state);
  std::vector<double> used;
  for (std::size_t m = 0; m < all.size(); ++m) {
    fit.used.push_back(weights_[m] > 0);
    if (fit.used.back()) used.push_back(all[m]);
  }
  fit.error = solve::median(used);
  return fit;
}

}  // namespace

std::vector<UnitMatch> in_units(const std::vector<Shape>& shapes, const std::vector<Match>& matches) {
  const auto at = [&](std::size_t head, geometry::Pixel pixel) {
    const geometry::Pixel center = shapes[head].center();
    return Eigen::Vector2d(Eigen::Vector2d(pixel.x - center.x, pixel.y - center.y) / shapes[head].unit());
  };
  std::vector<UnitMatch> all;
  all.reserve(matches.size());
  for (const Match& match : matches) {
    all.push_back({match.a, match.b, at(match.a, match.pixel_a), at(match.b, match.pixel_b)});
  }
  return all;
}

Result<LensRays> LensRays::make(const SharedLens& lens) {
  KannalaBrandtLens model = lens.model;
  model.focal *= kPixelsPerUnit;
  const Result<geometry::Lens> made = geometry::Lens::make(model);
  if (!made) return fail(made.error());
  return LensRays(*made, lens.aspect, lens.shift);
}

std::optional<Vector3d> LensRays::ray(const Eigen::Vector2d& at) const {
  const double x = at.x() - shift_.x(), y = (at.y() - shift_.y()) / aspect_, r = std::hypot(x, y);
  const std::optional<double> angle = lens_.angle(kPixelsPerUnit * r);
  if (!angle) return std::nullopt;
  const double s = r > 0 ? std::sin(*angle) / r : 0;
  return Vector3d(s * x, s * y, std::cos(*angle));
}

std::optional<Eigen::Vector2d> LensRays::at(const Vector3d& ray) const {
  const double side = std::hypot(ray.x(), ray.y());
  const std::optional<double> radius = lens_.radius(std::atan2(side, ray.z()));
  if (!radius) return std::nullopt;
  const double s = side > 0 ? *radius / kPixelsPerUnit / side : 0;
  return Eigen::Vector2d(s * ray.x() + shift_.x(), s * ray.y() * aspect_ + shift_.y());
}

BundleFit adjust(BundleState start, const std::vector<UnitMatch>& matches, const BundleRules& rules) {
  return Bundle(start, matches, rules).run(std::move(start));
}

}  // namespace nodal::autocalibration
