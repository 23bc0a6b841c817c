#include "stitch/registration/certainty.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "protocol/base/try.h"
#include "stitch/registration/descent.h"
#include "stitch/registration/gauge.h"
#include "stitch/registration/level.h"

namespace nodal::registration {
namespace {

// Chosen on rigs drawn by seeds (tests/bench/campaign.cpp).
constexpr double kMaxLeverage = 0.8;   // a part that alone determines a parameter is not left out altogether
constexpr double kStepTooShort = 1.5;  // steps to other lenses are too short, because large differences weigh less
constexpr double kInexactPx = 0.01;    // error of interpolation and blur
// Share of the largest curvature; the curvature of turns that a part does not determine is smaller.
constexpr double kDetermined = 1e-3;
// Two heads that are apart by d along both axes are brought together by turns of d / 2 each, whose rms over heads and
// axes is half of the displacement.
constexpr double kPairAndAxes = 2;
constexpr double kMaxExcess = 2;  // limit of own / common curvature; more is due to detail that is not aligned
// Part of noise's share that is subtracted; less than 1, because own curvatures are too large.
constexpr double kChanceShare = 0.4;
constexpr double kMaxLost = 1;  // limit of what parts do not remove, relative to what they remove

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// The quadratic model of the objective at the result, with all parameters of lenses and the distance.
class Model {
 public:
  Model(const Parameters& parameters, const std::vector<HeadState>& heads, const std::vector<Normal>& parts,
        double pixels_a_sample, const parallel::Workers& workers)
      : parameters_(parameters), heads_(heads), total_(parts.front()), gradients_(parts.size()), own_(parts.size()) {
    for (std::size_t p = 1; p < parts.size(); ++p) total_.add(parts[p]);
    noise_ = total_.objective() * pixels_a_sample;
    workers.run(static_cast<int>(parts.size()), [&](int p) {
      const auto i = static_cast<std::size_t>(p);
      if (parts[i].measure <= 0) return;
      gradients_[i] = parameters.gradient(parts[i]);
      own_[i] = parameters.hessian(parts[i], Curvature::kOwn);
    });
  }

  const Normal& total() const { return total_; }

  /// The step to the minimum if `sought` is estimated, lenses with soft priors.
  Vector step(const Sought& sought) const {
    const std::vector<bool> free = parameters_.part_of(sought);
    Matrix H = parameters_.hessian(total_, Curvature::kOwn) + noise_ * parameters_.lens_weights(heads_);
    Vector g = parameters_.gradient(total_);
    restrict_to(free, H);
    for (Eigen::Index k = 0; k < g.size(); ++k) {
      if (!free[static_cast<std::size_t>(k)]) g[k] = 0;
    }
    return step_to_minimum(parameters_, heads_, H, g, 0);
  }
  double share_removed_by(const Vector& step) const {
    return total_.cost > 0 ? -step.dot(parameters_.gradient(total_)) / total_.cost : 0;
  }

  /// Certainty::by_parts, and the displacement of two heads that these turns remove, rad.
  struct ByParts {
    double share = 0, displacement_rad = 0;
  };
  ByParts by_parts() const {
    if (total_.cost <= 0) return {};
    const std::vector<Eigen::Index> turns = rotation_columns();
    const Apart fine = turned_apart(turns, [](std::size_t part) { return part; });
    const Apart coarse = turned_apart(turns, coarse_part);
    // A displacement that changes steadily within a part is removed but for its change, whose square is proportional to
    // the square of the part's width: parts of width 0 are extrapolated from two widths.
    const double lost =
        std::clamp((fine.turn_squared() - coarse.turn_squared()) / 3, 0.0, kMaxLost * fine.turn_squared());
    const double turn = std::sqrt(fine.turn_squared() + lost);
    return {fine.removed / total_.cost, kPairAndAxes * curvature_excess(turns) * turn};
  }

  /// How much too large own curvatures of turns are, by the noise of the gradients.
  double curvature_excess(const std::vector<Eigen::Index>& turns) const {
    const double own = parameters_.hessian(total_, Curvature::kOwn)(turns, turns).trace();
    const double common = parameters_.hessian(total_, Curvature::kCommon)(turns, turns).trace();
    return common > 0 ? std::clamp(own / common, 1.0, kMaxExcess) : kMaxExcess;
  }

  /// Covariances of the free parameters if `sought` is estimated.
  struct Spread {
    Matrix noise, parts;
  };
  Spread spread(const Sought& sought) const {
    const std::vector<bool> free = parameters_.part_of(sought);
    const Matrix priors = noise_ * parameters_.lens_weights(heads_);
    Matrix own = parameters_.hessian(total_, Curvature::kOwn) + priors;
    Matrix H = parameters_.hessian(total_, Curvature::kCommon) + priors;
    restrict_to(free, own);
    restrict_to(free, H);
    // Where the common curvature is not positive it gives no estimate; the own curvature then gives a bound.
    if (least_eigenvalue(H, free) <= 0) H = own;
    const Matrix inverse = symmetric_system(H).inverse(), own_inverse = symmetric_system(own).inverse();
    Spread spread{inverse * noise_, Matrix::Zero(H.rows(), H.cols())};
    for (std::size_t p = 0; p < own_.size(); ++p) {
      if (own_[p].size() == 0) continue;
      const std::vector<Eigen::Index> at = parameters_of(own_[p]);
      const auto n = static_cast<Eigen::Index>(at.size());
      const Matrix rest = Matrix::Identity(n, n) - kMaxLeverage * own_[p](at, at) * own_inverse(at, at);
      // The change of the result without this part.
      const Vector pull = inverse(Eigen::all, at) * rest.partialPivLu().solve(gradients_[p](at));
      spread.parts += pull * pull.transpose();
    }
    return spread;
  }

 private:
  /// What turns of the heads in every part of the sphere by itself remove, without noise.
  struct Apart {
    double removed = 0, curvatures = 0;
    /// A turn by t removes curvature x t squared of the cost.
    double turn_squared() const { return curvatures > 0 ? std::max(0.0, removed) / curvatures : 0; }
  };
  template <class GroupOf>
  Apart turned_apart(const std::vector<Eigen::Index>& turns, const GroupOf& group_of) const {
    const auto n = static_cast<Eigen::Index>(turns.size());
    std::vector<Matrix> own(own_.size());
    std::vector<Vector> gradients(own_.size());
    for (std::size_t p = 0; p < own_.size() && n > 0; ++p) {
      if (own_[p].size() == 0) continue;
      const std::size_t group = group_of(p);
      if (own[group].size() == 0) {
        own[group] = Matrix::Zero(n, n);
        gradients[group] = Vector::Zero(n);
      }
      own[group] += own_[p](turns, turns);
      gradients[group] += gradients_[p](turns);
    }
    Apart sum;
    int determined = 0;
    for (std::size_t p = 0; p < own.size(); ++p) {
      const std::vector<Eigen::Index> at = parameters_of(own[p]);
      if (at.empty()) continue;
      const Eigen::SelfAdjointEigenSolver<Matrix> curvature(own[p](at, at));
      const Vector pulls = curvature.eigenvectors().transpose() * gradients[p](at);
      for (Eigen::Index k = 0; k < pulls.size(); ++k) {
        const double along = curvature.eigenvalues()[k];
        if (!(along > kDetermined * curvature.eigenvalues()[pulls.size() - 1])) continue;
        sum.removed += pulls[k] * pulls[k] / along;
        sum.curvatures += along;
        ++determined;
      }
    }
    sum.removed -= kChanceShare * noise_ * determined;
    return sum;
  }
  std::vector<Eigen::Index> rotation_columns() const {
    std::vector<Eigen::Index> columns;
    for (Eigen::Index column = 0; column < parameters_.basis().cols(); ++column) {
      for (std::size_t h = 0; h < heads_.size(); ++h) {
        const int slot = parameters_.slots()[h].rotation;
        const Eigen::Index row = static_cast<Eigen::Index>(h) * parameters_.stride() + slot;
        if (slot >= 0 && !parameters_.basis().block(row, column, 3, 1).isZero(0)) columns.push_back(column);
      }
    }
    return columns;
  }
  /// The parameters that a part of the sphere depends on: those of the few heads that see it.
  static std::vector<Eigen::Index> parameters_of(const Matrix& own) {
    std::vector<Eigen::Index> at;
    for (Eigen::Index k = 0; k < own.rows(); ++k) {
      if (own(k, k) > 0) at.push_back(k);
    }
    return at;
  }
  static void restrict_to(const std::vector<bool>& free, Matrix& H) {
    for (Eigen::Index k = 0; k < H.rows(); ++k) {
      if (free[static_cast<std::size_t>(k)]) continue;
      H.row(k).setZero();
      H.col(k).setZero();
    }
  }
  static double least_eigenvalue(Matrix H, const std::vector<bool>& free) {
    for (Eigen::Index k = 0; k < H.rows(); ++k) {
      if (!free[static_cast<std::size_t>(k)]) H(k, k) = H.diagonal().maxCoeff();
    }
    return H.size() > 0 ? Eigen::SelfAdjointEigenSolver<Matrix>(H).eigenvalues().minCoeff() : 1;
  }

  const Parameters& parameters_;
  const std::vector<HeadState>& heads_;
  Normal total_;
  double noise_ = 0;
  std::vector<Vector> gradients_;
  std::vector<Matrix> own_;  ///< empty where nothing is shared
};

/// The standard deviation along the worst direction of a square block.
double worst_of(const Matrix& covariance, Eigen::Index row, Eigen::Index size) {
  const Matrix block = covariance.block(row, row, size, size);
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix>(block).eigenvalues().maxCoeff()));
}

}  // namespace

Result<Certainty> certainty_of(Objective& objective, const std::vector<HeadState>& heads, const Sought& sought,
                               const Held& held, double pixels_a_sample, const std::vector<bool>& mean_of,
                               const parallel::Workers& workers) {
  Sought focals = sought, lenses = sought, near = sought;
  focals.focal = true;
  lenses.focal = lenses.lens = true;
  near.nearness =
      sought.nearness || std::ranges::any_of(heads, [](const HeadState& head) { return !head.position.isZero(0); });
  Sought every = lenses;
  every.nearness = near.nearness;
  const Parameters parameters(heads, every, held);
  NODAL_TRY_ASSIGN(const std::vector<Normal> parts, objective.evaluate_parts(heads, every));
  const Model model(parameters, heads, parts, pixels_a_sample, workers);
  const Vector to_focals = model.step(focals), to_lenses = model.step(lenses), to_distance = model.step(near);
  Certainty certainty;
  certainty.by_focals = model.share_removed_by(to_focals);
  certainty.by_lenses = model.share_removed_by(to_lenses);
  certainty.by_distance = model.share_removed_by(to_distance);
  const Model::ByParts parts_alone = model.by_parts();
  certainty.by_parts = parts_alone.share;
  certainty.parts_px = parts_alone.displacement_rad * pixels_per_radian(heads);
  if (near.nearness) certainty.distance_nearness = parameters.moved(heads, to_distance).front().nearness;

  Matrix to_all = parameters.basis();  // from the free parameters to all, relative to the gauge
  if (!mean_of.empty()) to_all = mean_taken_out(heads, mean_of, parameters) * to_all;
  const Model::Spread spread = model.spread(sought);
  const Matrix noise = to_all * spread.noise * to_all.transpose(), pulls = to_all * spread.parts * to_all.transpose();
  const Vector by_focals = to_all * to_focals, by_lenses = to_all * to_lenses, by_distance = to_all * to_distance;
  const auto scatter_of = [&](Eigen::Index row, Eigen::Index size) {
    return std::max(worst_of(noise, row, size), worst_of(pulls, row, size));
  };
  const auto bias_of = [&](Eigen::Index row, Eigen::Index size) {
    const auto moved_by = [&](const Vector& step) { return kStepTooShort * step.segment(row, size).norm(); };
    return std::hypot(std::max(moved_by(by_focals), moved_by(by_lenses)), moved_by(by_distance));
  };
  const auto sigma = [&](Eigen::Index row, Eigen::Index size) {
    return std::hypot(scatter_of(row, size), bias_of(row, size));
  };
  const double inexact = kInexactPx / pixels_per_radian(heads);
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const Slots& slots = parameters.slots()[h];
    const Eigen::Index row = static_cast<Eigen::Index>(h) * parameters.stride();
    const bool turns =
        slots.rotation >= 0 && !held.geometry[h] && (!mean_of.empty() || held.first != static_cast<int>(h));
    certainty.rotation_rad.push_back(turns ? std::hypot(sigma(row + slots.rotation, 3), inexact) : 0);
    certainty.bias_rad.push_back(turns ? bias_of(row + slots.rotation, 3) : 0);
    const bool focal = (sought.focal || sought.lens) && !held.geometry[h];
    certainty.log_focal.push_back(focal ? sigma(row + slots.focal, 1) : 0);
  }
  if (sought.nearness) {
    double farthest = 0;
    for (const HeadState& head : heads) farthest = std::max(farthest, head.position.norm());
    certainty.nearness = std::hypot(scatter_of(parameters.slots().front().nearness, 1), inexact / farthest);
  }
  return certainty;
}

}  // namespace nodal::registration
