#include "stitch/autocalibration/bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "stitch/geometry/rotation.h"
#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/robust.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kFarthest = 0.05;          // units; a match that is farther off is an outlier
constexpr double kNearest = 0.0004;         // units; features are not more accurate than this
constexpr double kRayleighMedian = 1.1774;  // the median length of an error, in standard deviations along one axis
constexpr double kOutlier = 6;              // standard deviations
constexpr double kLinear = 2;               // from here on Huber's norm is linear
// Standard deviation of log focal: cameras state it for infinity, in whole millimetres.
constexpr double kStatedFocalSigma = 0.1;
constexpr double kAspectSigma = 0.01;      // standard deviation of the log aspect around the prior's
constexpr double kMaxAspectChange = 0.05;  // largest change of the log aspect
constexpr int kRounds = 8;
constexpr int kStepsARound = 8;
// Number of matches that count against what is expected of a lens: errors of more have common causes, such as near
// things.
constexpr double kIndependent = 500;
constexpr std::size_t kFirstMatches = 4000;  // if there are many more, they are adjusted first
constexpr double kFirstLimit = 10;           // standard deviations of those within which the others may agree
constexpr double kSettledNoise = 1e-3;       // the rounds end with a smaller relative change of the noise
constexpr double kEnough = 1e-7;
constexpr int kOwnUnknowns = 3;  // log focal, the axis's shift
// px of the picture in which features are found: a blob of this scale has a spread of sqrt(2).
constexpr double kBigBlob = 3;

SharedLens moved_lens(SharedLens lens, const Eigen::Matrix<double, kLensUnknowns, 1>& step) {
  const auto by = [&](int unknown) { return std::clamp(step[unknown], -0.1, 0.1); };
  lens.model.focal *= std::exp(by(kLogFocal));
  lens.model.k[0] += by(kFirstRadial);
  lens.model.k[1] += by(kFirstRadial + 1);
  lens.aspect *= std::exp(by(kLogAspect));
  lens.shift += Vector2d(by(kShift), by(kShift + 1));
  return lens;
}

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

/// The lenses of a state's heads; empty if one of them is impossible.
std::vector<LensRays> lenses_of(const BundleState& state) {
  std::vector<LensRays> all;
  const std::size_t heads = state.R_head_rig.size();
  if (state.own.empty()) {
    if (const Result<LensRays> lens = LensRays::make(state.lens)) all.assign(heads, *lens);
    return all;
  }
  for (std::size_t h = 0; h < heads; ++h) {
    const Result<LensRays> lens = LensRays::make(state.lens_of(h));
    if (!lens) return {};
    all.push_back(*lens);
  }
  return all;
}

class Bundle {
 public:
  /// Matches that are farther off than `limit`, units, are outliers from the beginning.
  Bundle(const BundleState& start, const std::vector<UnitMatch>& matches, const BundleRules& rules, double limit)
      : matches_(matches), rules_(rules), limit_(limit) {
    Eigen::Index count = kLensUnknowns;
    for (std::size_t h = 0; h < start.R_head_rig.size(); ++h) {
      const bool turns = start.R_head_rig[h] && h != rules.first;
      turns_.push_back(turns ? count : -1);
      count += turns ? 3 : 0;
      const bool own = rules.own_sigma > 0 && start.R_head_rig[h];
      own_.push_back(own ? count : -1);
      count += own ? kOwnUnknowns : 0;
    }
    fixed_.assign(static_cast<std::size_t>(count), false);
    fixed_[kLogAspect] = !rules.free_aspect;
  }

  BundleFit run(BundleState start);

 private:
  /// The unknowns that a residual depends on, and its derivatives.
  struct Row {
    std::array<Eigen::Index, kLensUnknowns + 2 * (3 + kOwnUnknowns)> at{};
    Eigen::Matrix<double, 2, kLensUnknowns + 2 * (3 + kOwnUnknowns), Eigen::RowMajor> slope;
    std::size_t count = 0;
    template <class Block>
    void add(Eigen::Index first, const Block& block) {
      for (Eigen::Index k = 0; first >= 0 && k < block.cols(); ++k, ++count) {
        at[count] = first + k;
        slope.col(static_cast<Eigen::Index>(count)) = block.col(k);
      }
    }
  };
  void reweigh(const BundleState& state);
  solve::Evaluation evaluate(const BundleState& state) const;
  /// Adds the distance between where `to` sees a point and where `from` predicts it. False if a lens does not reach
  /// that far.
  bool add(const LensRays::RaySlopes& from, std::size_t from_head, const LensRays& to_lens, std::size_t to_head,
           const Vector2d& seen, const Matrix3d& R_to_from, double weight, solve::Evaluation& sum) const;
  void add_priors(const BundleState& state, solve::Evaluation& sum) const;
  BundleState moved(const BundleState& from, const Eigen::VectorXd& step) const;

  const std::vector<UnitMatch>& matches_;
  BundleRules rules_;
  std::vector<Eigen::Index> turns_, own_;  // a head's first unknown of each kind; -1: none
  std::vector<bool> fixed_;
  std::vector<double> weights_;
  double noise_ = 0, limit_;
};

void Bundle::reweigh(const BundleState& state) {
  const std::vector<double> all = errors_of(state, matches_);
  std::vector<double> near;
  for (const double error : all) {
    if (error < limit_) near.push_back(error);
  }
  noise_ = std::max(kNearest, solve::median(near) / kRayleighMedian);
  limit_ = std::min(limit_, kOutlier * noise_);
  const solve::Huber huber{kLinear * noise_};
  weights_.clear();
  for (std::size_t m = 0; m < all.size(); ++m) {
    const double spread = matches_[m].spread;
    weights_.push_back(all[m] < limit_ ? huber.weight(all[m]) / (2 * spread * spread) : 0);  // each error counts twice
  }
}

bool Bundle::add(const LensRays::RaySlopes& from, std::size_t from_head, const LensRays& to_lens, std::size_t to_head,
                 const Vector2d& seen, const Matrix3d& R_to_from, double weight, solve::Evaluation& sum) const {
  const Vector3d ray = R_to_from * from.ray;
  const auto to = to_lens.point_slopes(ray);
  if (!to) return false;
  const Eigen::Matrix<double, 2, 3> by_from = to->by_ray * R_to_from;
  const Eigen::Matrix<double, 2, kLensUnknowns> through_from = by_from * from.by_lens;
  Row row;
  row.add(0, Eigen::Matrix<double, 2, kLensUnknowns>(through_from + to->by_lens));
  // If a head turns by w, a ray r that is fixed in the rig becomes r + w x r in the head.
  row.add(turns_[from_head], Eigen::Matrix<double, 2, 3>(by_from * cross_matrix(from.ray)));
  row.add(turns_[to_head], Eigen::Matrix<double, 2, 3>(-to->by_ray * cross_matrix(ray)));
  const auto own_columns = [](const Eigen::Matrix<double, 2, kLensUnknowns>& by_lens) {
    Eigen::Matrix<double, 2, kOwnUnknowns> own;
    own << by_lens.col(kLogFocal), by_lens.col(kShift), by_lens.col(kShift + 1);
    return own;
  };
  row.add(own_[from_head], own_columns(through_from));
  row.add(own_[to_head], own_columns(to->by_lens));
  const Vector2d off = to->at - seen;
  for (Eigen::Index k = 0; k < 2; ++k) {
    sum.equations.add(std::span(row.at).first(row.count), std::span(row.slope.row(k).data(), row.count), off[k],
                      weight);
  }
  return true;
}

void Bundle::add_priors(const BundleState& state, solve::Evaluation& sum) const {
  const auto used = static_cast<double>(std::ranges::count_if(weights_, [](double weight) { return weight > 0; }));
  const double dependent = std::max(1.0, used / kIndependent);
  const auto hold = [&](Eigen::Index unknown, double off, double sigma) {
    const double one = 1;
    sum.equations.add(std::span(&unknown, 1), std::span(&one, 1), off, dependent * std::pow(noise_ / sigma, 2));
  };
  if (rules_.stated_focal > 0) {
    hold(kLogFocal, std::log(state.lens.model.focal / rules_.stated_focal), kStatedFocalSigma);
  }
  for (std::size_t k = 0; k < rules_.sigma.size(); ++k) {
    hold(kFirstRadial + static_cast<Eigen::Index>(k), state.lens.model.k[k] - rules_.prior.model.k[k], rules_.sigma[k]);
  }
  hold(kLogAspect, std::log(state.lens.aspect / rules_.prior.aspect), kAspectSigma);
  for (int k = 0; k < 2; ++k) hold(kShift + k, state.lens.shift[k], rules_.shift_sigma);
  for (std::size_t h = 0; h < own_.size(); ++h) {
    if (own_[h] < 0) continue;
    hold(own_[h], state.own[h].log_focal, rules_.own_sigma);
    for (int k = 0; k < 2; ++k) hold(own_[h] + 1 + k, state.own[h].shift[k], rules_.own_sigma);
  }
}

solve::Evaluation Bundle::evaluate(const BundleState& state) const {
  solve::Evaluation sum{solve::NormalEquations(static_cast<int>(fixed_.size()))};
  const auto impossible = [&] {
    sum.cost = solve::kImpossible;
    return sum;
  };
  const std::vector<LensRays> lenses = lenses_of(state);
  if (lenses.empty()) return impossible();
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    if (weights_[m] == 0) continue;
    const UnitMatch& match = matches_[m];
    const auto a = lenses[match.a].ray_slopes(match.at_a), b = lenses[match.b].ray_slopes(match.at_b);
    if (!a || !b) return impossible();
    const Matrix3d R_b_a = *state.R_head_rig[match.b] * state.R_head_rig[match.a]->transpose();
    const bool good = add(*a, match.a, lenses[match.b], match.b, match.at_b, R_b_a, weights_[m], sum) &&
                      add(*b, match.b, lenses[match.a], match.a, match.at_a, R_b_a.transpose(), weights_[m], sum);
    if (!good) return impossible();
  }
  add_priors(state, sum);
  sum.cost = sum.equations.cost();
  return sum;
}

BundleState Bundle::moved(const BundleState& from, const Eigen::VectorXd& step) const {
  BundleState state = from;
  state.lens = moved_lens(from.lens, step.head<kLensUnknowns>());
  const double most = std::exp(kMaxAspectChange);
  state.lens.aspect = std::clamp(state.lens.aspect, rules_.prior.aspect / most, rules_.prior.aspect * most);
  for (std::size_t h = 0; h < turns_.size(); ++h) {
    if (turns_[h] >= 0) {
      state.R_head_rig[h] = geometry::rotation_about(step.segment<3>(turns_[h])) * *from.R_head_rig[h];
    }
    if (own_[h] >= 0) {
      state.own[h].log_focal += step[own_[h]];
      state.own[h].shift += step.segment<2>(own_[h] + 1);
    }
  }
  return state;
}

BundleFit Bundle::run(BundleState start) {
  BundleFit fit;
  fit.state = std::move(start);
  if (rules_.own_sigma > 0) fit.state.own.resize(fit.state.R_head_rig.size());
  for (int round = 0; round < kRounds; ++round) {  // each one holds its weights
    const double noise = noise_, limit = limit_;
    reweigh(fit.state);
    // With the same weights, another round would hardly move.
    if (limit - limit_ < kSettledNoise * limit && std::abs(noise_ - noise) < kSettledNoise * noise) break;
    auto end = solve::descend(
        fit.state, [this](const BundleState& state) { return evaluate(state); },
        [this](const BundleState& from, const Eigen::VectorXd& step) { return moved(from, step); }, fixed_,
        {.most_steps = kStepsARound, .enough = kEnough, .first_damping = 1e-6});
    fit.state = std::move(end.state);
  }
  reweigh(fit.state);
  fit.errors = errors_of(fit.state, matches_);
  fit.noise = noise_;
  std::vector<double> used;
  for (std::size_t m = 0; m < fit.errors.size(); ++m) {
    fit.used.push_back(weights_[m] > 0);
    if (fit.used.back()) used.push_back(fit.errors[m]);
  }
  fit.error = solve::median(used);
  const solve::Evaluation at = evaluate(fit.state);
  if (std::isfinite(at.cost)) {
    fit.covariance = noise_ * noise_ * at.equations.covariance(fixed_).topLeftCorner<3, 3>();
  }
  for (std::size_t k = 0; k < rules_.sigma.size(); ++k) {
    fit.held += std::pow((fit.state.lens.model.k[k] - rules_.prior.model.k[k]) / rules_.sigma[k], 2);
  }
  return fit;
}

}  // namespace

SharedLens BundleState::lens_of(std::size_t head) const {
  SharedLens its = lens;
  if (own.empty()) return its;
  its.model.focal *= std::exp(own[head].log_focal);
  its.shift += own[head].shift;
  return its;
}

std::vector<UnitMatch> in_units(const std::vector<Shape>& shapes, const std::vector<Match>& matches) {
  const auto at = [&](std::size_t head, geometry::Pixel pixel) {
    const geometry::Pixel center = shapes[head].center();
    return Vector2d(Vector2d(pixel.x - center.x, pixel.y - center.y) / shapes[head].unit());
  };
  std::vector<UnitMatch> all;
  all.reserve(matches.size());
  for (const Match& match : matches) {
    const double blob = match.scale / kBigBlob;
    all.push_back(
        {match.a, match.b, at(match.a, match.pixel_a), at(match.b, match.pixel_b), std::sqrt(1 + blob * blob)});
  }
  return all;
}

std::vector<double> errors_of(const BundleState& state, const std::vector<UnitMatch>& matches) {
  std::vector<double> all(matches.size(), std::numeric_limits<double>::infinity());
  const std::vector<LensRays> lenses = lenses_of(state);
  if (lenses.empty()) return all;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    const UnitMatch& match = matches[m];
    if (!state.R_head_rig[match.a] || !state.R_head_rig[match.b]) continue;
    const auto a = lenses[match.a].ray(match.at_a), b = lenses[match.b].ray(match.at_b);
    if (!a || !b) continue;
    const Matrix3d R_b_a = *state.R_head_rig[match.b] * state.R_head_rig[match.a]->transpose();
    const auto in_b = lenses[match.b].at(R_b_a * *a), in_a = lenses[match.a].at(R_b_a.transpose() * *b);
    if (!in_a || !in_b) continue;
    const double square = ((*in_a - match.at_a).squaredNorm() + (*in_b - match.at_b).squaredNorm()) / 2;
    all[m] = std::sqrt(square) / match.spread;
  }
  return all;
}

BundleFit adjust(BundleState start, const std::vector<UnitMatch>& matches, const BundleRules& rules) {
  double limit = kFarthest;
  if (matches.size() > 2 * kFirstMatches) {
    // From the result of some matches, all of them need few steps.
    std::vector<UnitMatch> some;
    for (std::size_t n = 0; n < kFirstMatches; ++n) some.push_back(matches[n * matches.size() / kFirstMatches]);
    BundleFit first = Bundle(start, some, rules, limit).run(start);
    limit = std::min(limit, kFirstLimit * first.noise);
    start = std::move(first.state);
  }
  return Bundle(start, matches, rules, limit).run(start);
}

}  // namespace nodal::autocalibration
