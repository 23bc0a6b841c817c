#include "stitch/calibration/lens/photometry.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "stitch/geometry/lens/rising_polynomial.h"
#include "stitch/geometry/response.h"
#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/robust.h"

namespace nodal::calibration {
namespace {

constexpr int kFlare = 0, kVignetting = 1, kCurve = 4;  // indices of the shared unknowns
constexpr int kMaxCurve = 3;
constexpr int kShared = kCurve + kMaxCurve;
constexpr int kLightOwn = 5;                       // gain, slope x, slope y, x^2 - y^2, x y
constexpr double kLowest = 0.02, kHighest = 0.98;  // outside, recorded values are crushed or saturated
constexpr double kFoot = 0.002;                    // share of full light
constexpr solve::Huber kLightHuber{0.03};
constexpr double kClearly = 0.9;  // a polynomial's rms must be below this share of the gamma curve's

struct State {
  std::array<double, kShared> shared{};
  std::vector<std::array<double, kLightOwn>> own;
};

/// Samples with positions in -1..1 and the squared radius relative to `radius`.
struct Placed {
  int view;
  double x, y, s, light, value;
};

/// The light of an encoded value under the curve being fitted, its slope, and its derivatives by the curve's
/// unknowns.
struct Decoded {
  double encoded, slope;
  std::array<double, kMaxCurve> by_curve;
};

Response response_of(const State& state, bool gamma) {
  Response response;
  if (gamma) {
    response.curve = Response::Curve::kGamma;
    response.gamma = state.shared[kCurve];
    return response;
  }
  response.curve = Response::Curve::kPolynomial;
  double first = 1;
  for (int k = 0; k < kMaxCurve; ++k) first -= state.shared[static_cast<std::size_t>(kCurve + k)];
  response.coefficients = {first};
  for (std::size_t k = 0; k < kMaxCurve; ++k) response.coefficients.push_back(state.shared[kCurve + k]);
  return response;
}

bool rises(const Response& response) {
  if (response.curve == Response::Curve::kGamma) return response.gamma > 0.2 && response.gamma < 5;
  return geometry::RisingPolynomial(response.coefficients, 1.0).max_x() >= 1.0;
}

/// A curve prepared for many evaluations; `polynomial` is used if it is not a gamma curve.
struct Curve {
  Response response;
  std::optional<geometry::RisingPolynomial> polynomial;

  explicit Curve(const Response& of) : response(of) {
    if (of.curve != Response::Curve::kGamma) polynomial.emplace(of.coefficients, 1.0);
  }
  double encode(double light) const {
    return polynomial ? polynomial->inverse(std::min(light, 1.0)).value_or(1.0) : geometry::encode(response, light);
  }
};

/// Below kFoot of light a curve may be infinitely steep, so its tangent at kFoot replaces it.
Decoded encode_with_slopes(const Curve& curve, double light) {
  Decoded d{};
  const double e = std::max(curve.encode(std::max(light, kFoot)), 1e-4);
  if (!curve.polynomial) {
    const double gamma = curve.response.gamma;
    d.slope = gamma * std::pow(e, gamma - 1);
    d.by_curve[0] = std::pow(e, gamma) * std::log(e);
    d.encoded = e + std::min(light - kFoot, 0.0) / d.slope;
    return d;
  }
  d.slope = std::max(curve.polynomial->slope(e), 1e-6);
  d.encoded = e + std::min(light - kFoot, 0.0) / d.slope;
  for (int k = 0; k < kMaxCurve; ++k) d.by_curve[static_cast<std::size_t>(k)] = std::pow(e, k + 2) - e;
  return d;
}

solve::Evaluation evaluate(const State& state, const std::vector<Placed>& samples, bool gamma) {
  const Response response = response_of(state, gamma);
  solve::Evaluation sum{solve::NormalEquations(kShared, kLightOwn, static_cast<int>(state.own.size()))};
  if (!rises(response)) {
    sum.cost = solve::kImpossible;
    return sum;
  }
  const Curve curve(response);
  const auto& v = state.shared;
  for (const Placed& p : samples) {
    const auto& own = state.own[static_cast<std::size_t>(p.view)];
    const std::array<double, kLightOwn> field{1, p.x, p.y, p.x * p.x - p.y * p.y, p.x * p.y};
    double lamp = 0;
    for (std::size_t k = 0; k < kLightOwn; ++k) lamp += own[k] * field[k];
    const double fall = 1 + p.s * (v[kVignetting] + p.s * (v[kVignetting + 1] + p.s * v[kVignetting + 2]));
    const double seen = p.light + v[kFlare];
    const Decoded d = encode_with_slopes(curve, lamp * fall * seen);
    const double residual = d.encoded - p.value;
    const double by_light = 1 / d.slope;
    std::array<double, kShared> by_shared{};
    by_shared[kFlare] = by_light * lamp * fall;
    by_shared[kVignetting] = by_light * lamp * seen * p.s;
    by_shared[kVignetting + 1] = by_shared[kVignetting] * p.s;
    by_shared[kVignetting + 2] = by_shared[kVignetting + 1] * p.s;
    for (std::size_t k = 0; k < kMaxCurve; ++k) by_shared[kCurve + k] = -d.by_curve[k] / d.slope;
    std::array<double, kLightOwn> by_own;
    for (std::size_t k = 0; k < kLightOwn; ++k) by_own[k] = by_light * fall * seen * field[k];
    const double size = std::abs(residual);
    sum.equations.add(p.view, by_shared.data(), by_own.data(), residual, kLightHuber.weight(size));
    sum.cost += kLightHuber.cost(size);
  }
  return sum;
}

State moved(const State& from, const Eigen::VectorXd& step) {
  State next = from;
  for (std::size_t k = 0; k < kShared; ++k) next.shared[k] += step[static_cast<Eigen::Index>(k)];
  for (std::size_t v = 0; v < next.own.size(); ++v) {
    for (std::size_t k = 0; k < kLightOwn; ++k)
      next.own[v][k] += step[static_cast<Eigen::Index>(kShared + v * kLightOwn + k)];
  }
  return next;
}

solve::Descent<State, solve::Evaluation> fit(State start, const std::vector<Placed>& samples, bool gamma) {
  std::vector<bool> fixed(kShared + start.own.size() * kLightOwn, false);
  if (gamma) fixed[kCurve + 1] = fixed[kCurve + 2] = true;
  return solve::descend(std::move(start), [&](const State& s) { return evaluate(s, samples, gamma); }, moved, fixed,
                        {.most_steps = 60, .enough = 1e-7, .first_damping = 1e-3});
}

}  // namespace

Photometry fit_photometry(const std::vector<LightSample>& samples, int views, const HeadCalibration& head,
                          double radius) {
  std::vector<Placed> placed;
  for (const LightSample& sample : samples) {
    if (sample.value < kLowest || sample.value > kHighest) continue;
    const double r = std::hypot(sample.x - head.center_x, (sample.y - head.center_y) / head.aspect) / radius;
    placed.push_back({sample.view, 2 * sample.x / head.width - 1, 2 * sample.y / head.height - 1, r * r, sample.light,
                      sample.value});
  }
  State start;
  start.own.resize(static_cast<std::size_t>(views), {0.6, 0, 0, 0, 0});
  start.shared[kFlare] = 0.02;
  start.shared[kCurve] = 2.0;
  const auto gamma = fit(start, placed, true);
  State bend = gamma.state;
  for (int k = 0; k < kMaxCurve; ++k) bend.shared[static_cast<std::size_t>(kCurve + k)] = k == 0 ? 0.8 : 0.05;
  const auto polynomial = fit(bend, placed, false);
  const bool take_gamma = gamma.at.cost * kClearly * kClearly <= polynomial.at.cost;
  const auto& best = take_gamma ? gamma : polynomial;
  Photometry result;
  result.response = response_of(best.state, take_gamma);
  for (std::size_t k = 0; k < 3; ++k) result.vignetting[k] = best.state.shared[kVignetting + k];
  double most = 1e-12;
  for (const auto& own : best.state.own) most = std::max(most, own[0]);
  for (const auto& own : best.state.own) result.gains.push_back(own[0] / most);
  result.rms = std::sqrt(best.at.cost / std::max<double>(1, static_cast<double>(placed.size())));
  return result;
}

}  // namespace nodal::calibration
