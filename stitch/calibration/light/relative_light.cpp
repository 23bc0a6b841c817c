#include "stitch/calibration/light/relative_light.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/calibration/light/light_fit.h"
#include "stitch/solve/robust.h"

namespace nodal::calibration {
namespace {

constexpr double kLn2 = std::numbers::ln2;
constexpr int kRounds = 12;
constexpr double kFarFromOthers = 1.5;  // standard deviations
constexpr double kHold = 1e-6;          // part of a typical weight that holds the mean of the heads at zero
constexpr double kMinScale = 1e-6;

/// One light, seen by some heads: their logarithms less the unknown gains.
struct Light {
  std::vector<Eigen::Index> head;
  std::vector<double> value, weight;
};

std::vector<Light> lights_of(const LightModel& model, const LightGroups& groups) {
  std::vector<Light> lights;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups.all[groups.first[g]].channel != 0) continue;
    Light light;
    for (std::size_t i = groups.first[g]; i < groups.first[g + 1]; ++i) {
      light.head.push_back(groups.all[i].head);
      light.value.push_back(log_light(model, groups.all[i]));
      light.weight.push_back(groups.all[i].weight);
    }
    lights.push_back(std::move(light));
  }
  return lights;
}

/// What is left of a weight at so many standard deviations. The first rounds find what most rays say; the later ones
/// leave out what is far from it, such as a thing that only one head sees.
double share_of(double deviations, int round) {
  if (round < kRounds / 2) return std::min(1.0, kFarFromOthers / std::max(deviations, kMinScale));
  const double far = deviations / (2 * kFarFromOthers);
  return 1 / std::pow(1 + far * far, 2);
}

/// The distance of each value from the mean of its light, after the gains.
std::vector<double> values_apart(const Light& light, const std::vector<double>& weight, const Eigen::VectorXd& gain) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < light.head.size(); ++i) {
    sum += weight[i] * (light.value[i] - gain[light.head[i]]);
    total += weight[i];
  }
  std::vector<double> apart;
  for (std::size_t i = 0; i < light.head.size(); ++i) {
    apart.push_back(light.value[i] - gain[light.head[i]] - sum / total);
  }
  return apart;
}

}  // namespace

RelativeLight relative_light(const Calibration& calibration, const std::vector<geometry::Head>& heads,
                             const ExposedSet& set) {
  const auto count = static_cast<Eigen::Index>(heads.size());
  std::vector<Light> lights = lights_of(model_of(calibration), shared_rays(heads, {set}));
  RelativeLight found{std::vector<double>(heads.size(), 0), std::vector<double>(heads.size(), HUGE_VAL)};
  if (lights.empty()) return found;
  Eigen::VectorXd gain = Eigen::VectorXd::Zero(count);
  Eigen::MatrixXd inverse;
  double scale = 1;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> sizes;
    for (const Light& light : lights) {
      const std::vector<double> apart = values_apart(light, light.weight, gain);
      for (std::size_t i = 0; i < apart.size(); ++i) sizes.push_back(std::abs(apart[i]) * std::sqrt(light.weight[i]));
    }
    std::vector<double> sorted = sizes;
    scale = std::max(solve::kSigmaPerMedian * solve::median(sorted), kMinScale);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
    std::size_t at = 0;
    for (const Light& light : lights) {
      std::vector<double> weight = light.weight;
      for (double& w : weight) w *= share_of(sizes[at++] / scale, round);
      const std::vector<double> apart = values_apart(light, weight, Eigen::VectorXd::Zero(count));
      double total = 0;
      for (const double w : weight) total += w;
      for (std::size_t i = 0; i < weight.size(); ++i) {
        right[light.head[i]] += weight[i] * apart[i];
        normal(light.head[i], light.head[i]) += weight[i];
        for (std::size_t k = 0; k < weight.size(); ++k) {
          normal(light.head[i], light.head[k]) -= weight[i] * weight[k] / total;
        }
      }
    }
    // Only differences are determined; of all gains with them those of least size are taken.
    normal.diagonal().array() += std::max(kHold * normal.diagonal().maxCoeff(), kMinScale);
    inverse = normal.ldlt().solve(Eigen::MatrixXd::Identity(count, count));
    gain = inverse * right;
  }
  constexpr int kMinSharedRays = 60;
  std::vector<int> rays(heads.size(), 0);
  for (const Light& light : lights) {
    for (const Eigen::Index head : light.head) ++rays[static_cast<std::size_t>(head)];
  }
  for (std::size_t h = 0; h < heads.size(); ++h) {
    if (rays[h] < kMinSharedRays) continue;
    // The uncertain mean of all is no part of a head's difference from it.
    const auto k = static_cast<Eigen::Index>(h);
    const double variance = inverse(k, k) - inverse.row(k).mean() * 2 + inverse.mean();
    found.stops[h] = gain[k] / kLn2;
    found.sigma[h] = scale * std::sqrt(std::max(0.0, variance)) / kLn2;
  }
  return found;
}

}  // namespace nodal::calibration
