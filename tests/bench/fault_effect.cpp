#include "tests/bench/fault_effect.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "stitch/geometry/head.h"

namespace nodal::bench {
namespace {

using geometry::Head;
using geometry::Ray;
constexpr int kDirections = 5000;  // spread evenly over the sphere
constexpr double kEdgePx = 2;      // gradients need pixels on both sides

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using Gradient = Eigen::RowVector2d;

Eigen::Vector3d direction(int k) {
  const double y = 1 - (2 * k + 1.0) / kDirections, turn = k * std::numbers::pi * (3 - std::sqrt(5.0)),
               r = std::sqrt(1 - y * y);
  return {r * std::cos(turn), y, r * std::sin(turn)};
}

std::vector<Head> heads_of(const Calibration& calibration) {
  std::vector<Head> heads;
  for (const HeadCalibration& head : calibration.heads) heads.push_back(*Head::make(head));
  return heads;
}

/// Rays as tangent vectors from pixels.
Eigen::Matrix<double, 3, 2> tangent_of(const Eigen::Matrix<double, 2, 3>& J) {
  return J.transpose() * (J * J.transpose()).inverse();
}

/// How the model's pixel changes with what is estimated: rotation, then focal length, then centre and radial terms.
Matrix columns_of(const geometry::Projection& at, const Eigen::Vector3d& ray, const Head& head,
                  registration::Free free) {
  const int count = free == registration::Free::kRotations ? 3 : free == registration::Free::kFocals ? 4 : 9;
  Matrix columns(2, count);
  for (int k = 0; k < 3; ++k) columns.col(k) = at.J * Eigen::Vector3d::Unit(k).cross(ray);
  if (count == 3) return columns;
  const HeadCalibration& calibration = head.calibration();
  const Eigen::Vector2d from(at.pixel.x - calibration.center_x, at.pixel.y - calibration.center_y);
  columns.col(3) = from;
  if (count == 4) return columns;
  columns.col(4) = Eigen::Vector2d::UnitX();
  columns.col(5) = Eigen::Vector2d::UnitY();
  const double angle = std::acos(std::clamp((head.R_head_rig() * ray).z(), -1.0, 1.0));
  for (int k = 0; k < 3; ++k) columns.col(6 + k) = from * std::pow(angle, k + 1);
  return columns;
}

/// What a ray is in one head: where the model says that it is, and where it really is.
struct Sighting {
  std::size_t head = 0;
  geometry::Projection at;
  Eigen::Vector3d displaced;  ///< the displacement as a tangent of the ray
  Matrix columns;             ///< derivatives by the head's parameters, as tangents
};

/// The derivative of a picture by its pixels.
Gradient gradient_at(const std::vector<std::uint8_t>& picture, int width, geometry::Pixel pixel) {
  const int x = static_cast<int>(pixel.x), y = static_cast<int>(pixel.y);
  const auto level = [&](int i, int j) {
    return static_cast<double>(picture[static_cast<std::size_t>(j * width + i)]);
  };
  return {(level(x + 1, y) - level(x - 1, y)) / 2, (level(x, y + 1) - level(x, y - 1)) / 2};
}

/// By how much pictures change if a ray's light moves by a tangent of the ray. Squared, because two pictures with
/// independent noise are used: their product has no noise of its own.
double change_squared(const DrawnRig& rig, const Sighting& seen, const Eigen::Vector3d& tangent) {
  const Eigen::Vector2d moved = seen.at.J * tangent;
  const int width = rig.seen.truth.heads[seen.head].width;
  return gradient_at(rig.seen.bytes[seen.head], width, seen.at.pixel).dot(moved) *
         gradient_at(rig.again.bytes[seen.head], width, seen.at.pixel).dot(moved);
}

/// Rms change of light, over noise, by the part of the displacement between `model` and the truth that no estimate
/// removes. `really(h, ray)`: the pixel at which head h really sees what is in the ray's direction.
template <class Really>
double displacement_effect(const DrawnRig& rig, const std::vector<Head>& model, const Really& really) {
  std::vector<std::vector<Sighting>> rays;
  for (int k = 0; k < kDirections; ++k) {
    const Eigen::Vector3d ray = direction(k);
    std::vector<Sighting> seen;
    for (std::size_t h = 0; h < model.size(); ++h) {
      const auto at = model[h].project_with_jacobian(Ray::towards(ray));
      if (!at || model[h].distance_to_edge(at->pixel) < kEdgePx) continue;
      const std::optional<geometry::Pixel> projected = really(h, ray);
      if (!projected) continue;
      const Eigen::Matrix<double, 3, 2> tangent = tangent_of(at->J);
      seen.push_back({h, *at, tangent * Eigen::Vector2d(projected->x - at->pixel.x, projected->y - at->pixel.y),
                      tangent * columns_of(*at, ray, model[h], rig.options.free)});
    }
    if (seen.size() >= 2) rays.push_back(std::move(seen));
  }
  if (rays.empty()) return 0;
  const Eigen::Index each = rays.front().front().columns.cols();
  const Eigen::Index n = each * static_cast<Eigen::Index>(model.size());
  Matrix A = Matrix::Zero(n, n);
  Vector b = Vector::Zero(n);
  const auto for_pairs = [&](const auto& act) {
    for (const std::vector<Sighting>& seen : rays) {
      for (std::size_t i = 0; i < seen.size(); ++i) {
        for (std::size_t j = i + 1; j < seen.size(); ++j) act(seen[i], seen[j]);
      }
    }
  };
  const auto row_of = [&](const Sighting& seen) { return static_cast<Eigen::Index>(seen.head) * each; };
  for_pairs([&](const Sighting& one, const Sighting& other) {
    const Eigen::Vector3d apart = one.displaced - other.displaced;
    b.segment(row_of(one), each) += one.columns.transpose() * apart;
    b.segment(row_of(other), each) -= other.columns.transpose() * apart;
    A.block(row_of(one), row_of(one), each, each) += one.columns.transpose() * one.columns;
    A.block(row_of(other), row_of(other), each, each) += other.columns.transpose() * other.columns;
    const Matrix mixed = one.columns.transpose() * other.columns;
    A.block(row_of(one), row_of(other), each, each) -= mixed;
    A.block(row_of(other), row_of(one), each, each) -= mixed.transpose();
  });
  A.diagonal() += 1e-9 * (A.diagonal() + Vector::Constant(n, 1e-12));  // the whole rig may turn
  const Vector fitted = A.ldlt().solve(b);
  double sum = 0, count = 0;
  for_pairs([&](const Sighting& one, const Sighting& other) {
    const Eigen::Vector3d rest = one.displaced - one.columns * fitted.segment(row_of(one), each) - other.displaced +
                                 other.columns * fitted.segment(row_of(other), each);
    sum += (change_squared(rig, one, rest) + change_squared(rig, other, rest)) / 2;
    ++count;
  });
  return std::sqrt(std::max(0.0, sum / count)) / kNoiseLevels;
}

double parallax_effect(const DrawnRig& rig) {
  if (!rig.room) return 0;
  Calibration from_one_point = rig.seen.truth;
  for (HeadCalibration& head : from_one_point.heads) head.position = {};
  const std::vector<Head> model = heads_of(from_one_point);
  const auto really = [&](std::size_t h, const Eigen::Vector3d& ray) -> std::optional<geometry::Pixel> {
    const auto& at = rig.seen.truth.heads[h].position;
    const Eigen::Vector3d way =
        test::range_in(*rig.room, {0, 0, 0}, {ray.x(), ray.y(), ray.z()}) * ray - Eigen::Vector3d(at[0], at[1], at[2]);
    const Eigen::Vector3d seen = way.normalized();
    if (test::range_in(*rig.room, at, {seen.x(), seen.y(), seen.z()}) < 0.99 * way.norm()) return {};  // hidden
    return model[h].project(Ray::towards(seen));
  };
  return displacement_effect(rig, model, really);
}

double lens_effect(const DrawnRig& rig) {
  Calibration wrong = rig.seen.truth;
  for (std::size_t h = 0; h < wrong.heads.size(); ++h) {
    wrong.heads[h].lens = rig.prior.heads[h].lens;
    wrong.heads[h].center_x = rig.prior.heads[h].center_x;
    wrong.heads[h].center_y = rig.prior.heads[h].center_y;
  }
  const std::vector<Head> truth = heads_of(rig.seen.truth);
  return displacement_effect(rig, heads_of(wrong), [&](std::size_t h, const Eigen::Vector3d& ray) {
    return truth[h].project(Ray::towards(ray));
  });
}

}  // namespace

FaultEffect effect_of(const DrawnRig& rig) {
  FaultEffect effect;
  effect.parallax = parallax_effect(rig);
  effect.lens = lens_effect(rig);
  const std::vector<Head> heads = heads_of(rig.seen.truth);
  for (std::size_t h = 0; h < heads.size(); ++h) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    double px_per_radian = 0;
    for (int k = 0; k < kDirections; ++k) {
      const Eigen::Vector3d ray = direction(k);
      const auto at = heads[h].project_with_jacobian(Ray::towards(ray));
      if (!at || heads[h].distance_to_edge(at->pixel) < kEdgePx) continue;
      double noise = 0;  // inverse variance of the best mean of the other heads
      for (std::size_t other = 0; other < heads.size(); ++other) {
        if (other == h) continue;
        const auto projected = heads[other].project(Ray::towards(ray));
        if (!projected || heads[other].distance_to_edge(*projected) < kEdgePx) continue;
        noise += 1 / (rig.noise[other] * rig.noise[other]);
      }
      if (noise == 0) continue;
      const int width = heads[h].width();
      const auto by_turn = [&](const test::RenderedRig& seen) {
        Eigen::Vector3d change;
        const Gradient gradient = gradient_at(seen.bytes[h], width, at->pixel);
        for (int axis = 0; axis < 3; ++axis)
          change[axis] = gradient.dot(at->J * Eigen::Vector3d::Unit(axis).cross(ray));
        return change;
      };
      const double pixels = heads[h].density(at->pixel) * 4 * std::numbers::pi / kDirections;
      const Eigen::Matrix3d product = by_turn(rig.seen) * by_turn(rig.again).transpose();
      information += pixels / (rig.noise[h] * rig.noise[h] + 1 / noise) * 0.5 * (product + product.transpose());
      px_per_radian = std::max(px_per_radian, std::sqrt(heads[h].density(at->pixel)));
    }
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues().minCoeff();
    effect.head_px.push_back(least > 0 ? px_per_radian / std::sqrt(least) : std::numeric_limits<double>::infinity());
  }
  return effect;
}

}  // namespace nodal::bench
