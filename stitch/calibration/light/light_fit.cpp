#include "stitch/calibration/light/light_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>

#include "protocol/base/units.h"
#include "stitch/geometry/lens/rising_polynomial.h"
#include "stitch/geometry/response.h"

namespace nodal::calibration {
namespace {

constexpr double kHuber = 1.5;        // scatters
constexpr int kSteps = 30;
constexpr double kStill = 1e-7;
constexpr double kLoosely = 4;        // weight of "no fall-off" where nothing else says
constexpr double kHeld = 1e6;         // weight of what must not move, and of which the data say nothing
constexpr double kLeastLight = 1e-4;
constexpr double kLeastFall = 0.02;
constexpr double kClearly = 0.85;     // of a gamma curve's rms
constexpr std::size_t kMostTerms = 4;

/// ln light of an observation, and its slopes by the few unknowns it depends on.
struct Linear {
  double log_light = 0;
  std::array<Eigen::Index, kMostTerms> unknown{};
  std::array<double, kMostTerms> slope{};
  std::size_t count = 0;

  void add(Eigen::Index which, double by) {
    unknown[count] = which;
    slope[count++] = by;
  }
};
using Linearize = std::function<Linear(const Observation&)>;
using Lines = std::vector<Linear>;
using Numbers = std::vector<double>;

struct Normal {
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
};

/// Calls back with each group's first observation, its lines, and each one's distance from their weighted mean.
template <class Take>
void each_group(const LightGroups& groups, const Linearize& linearize, Take&& take) {
  std::vector<Linear> lines;
  std::vector<double> apart;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    lines.clear();
    double sum = 0, weight = 0;
    for (std::size_t i = groups.first[g]; i < groups.first[g + 1]; ++i) {
      lines.push_back(linearize(groups.all[i]));
      sum += groups.all[i].weight * lines.back().log_light;
      weight += groups.all[i].weight;
    }
    apart.clear();
    for (const Linear& line : lines) apart.push_back(line.log_light - sum / weight);
    take(groups.first[g], lines, apart);
  }
}

/// What a typical observation is off by, in units of its own standard deviation; an outlier does not move it.
double scatter(const LightGroups& groups, const Linearize& linearize) {
  std::vector<double> sizes;
  each_group(groups, linearize, [&](std::size_t first, const Lines& lines, const Numbers& apart) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
      sizes.push_back(std::abs(apart[i]) * std::sqrt(groups.all[first + i].weight));
    }
  });
  if (sizes.empty()) return 1;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::max(1.4826 * *middle, 1e-6);
}

Normal gather(const LightGroups& groups, Eigen::Index unknowns, const Linearize& linearize, double scale) {
  Normal n{Eigen::MatrixXd::Zero(unknowns, unknowns), Eigen::VectorXd::Zero(unknowns)};
  std::vector<double> weights;
  std::vector<std::pair<Eigen::Index, double>> mean;
  each_group(groups, linearize, [&](std::size_t first, const Lines& lines, const Numbers& apart) {
    weights.clear();
    mean.clear();
    double sum = 0, off = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const double own = groups.all[first + i].weight;
      const double size = std::abs(apart[i]) * std::sqrt(own) / scale;
      weights.push_back((size <= kHuber ? own : own * kHuber / size) / (scale * scale));
      sum += weights.back();
      off += weights.back() * apart[i];
    }
    off /= sum;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const Linear& line = lines[i];
      for (std::size_t k = 0; k < line.count; ++k) {
        const double pull = weights[i] * line.slope[k];
        n.b[line.unknown[k]] += pull * (apart[i] - off);
        for (std::size_t l = 0; l < line.count; ++l) n.A(line.unknown[k], line.unknown[l]) += pull * line.slope[l];
        mean.emplace_back(line.unknown[k], pull);
      }
    }
    for (const auto& [k, a] : mean) {
      for (const auto& [l, c] : mean) n.A(k, l) -= a * c / sum;
    }
  });
  return n;
}

double fall_off(const std::array<double, 3>& v, double s) { return 1 + s * (v[0] + s * (v[1] + s * v[2])); }

/// ln decode(value); values where a curve says next to no light are no use as logarithms.
double log_decoded(const Response& response, double value) {
  return std::log(std::max(geometry::decode(response, value), kLeastLight));
}

double log_light(const LightModel& model, const Observation& o) {
  const auto h = static_cast<std::size_t>(o.head);
  return log_decoded(model.response[h], o.value) - model.log_gain[h][static_cast<std::size_t>(o.channel)] -
         std::log(std::max(fall_off(model.vignetting[h], o.s), kLeastFall)) - std::log(2.0) * o.stops;
}

/// A curve as numbers: gamma alone, or c2, c3, c4 of a polynomial (the first makes them sum to one).
Response curve_of(const Eigen::VectorXd& x) {
  Response response;
  if (x.size() == 1) {
    response.curve = Response::Curve::kGamma;
    response.gamma = x[0];
  } else {
    response.curve = Response::Curve::kPolynomial;
    response.coefficients = {1 - x.sum(), x[0], x[1], x[2]};
  }
  return response;
}

bool rises(const Eigen::VectorXd& x) {
  if (x.size() == 1) return std::isfinite(x[0]);
  return x.allFinite() && geometry::RisingPolynomial(curve_of(x).coefficients, 1.0).max_x() >= 1.0;
}

Linear curve_line(const Eigen::VectorXd& x, const Observation& o) {
  Linear line;
  const double e = o.value;
  if (x.size() == 1) {
    line.log_light = x[0] * std::log(e) - std::log(2.0) * o.stops;
    line.add(0, std::log(e));
    return line;
  }
  double light = e;
  for (Eigen::Index k = 0; k < x.size(); ++k) light += x[k] * (std::pow(e, k + 2) - e);
  light = std::max(light, kLeastLight);
  line.log_light = std::log(light) - std::log(2.0) * o.stops;
  for (Eigen::Index k = 0; k < x.size(); ++k) line.add(k, (std::pow(e, k + 2) - e) / light);
  return line;
}

/// The curve that x leads to, with what it leaves over in scatters of `scale` and x's covariance.
struct CurveFit {
  Eigen::VectorXd x;
  double rms = 0;
  double sigma = 0;
};

CurveFit descend_curve(const LightGroups& groups, Eigen::VectorXd x) {
  const auto lines = [&x](const Observation& o) { return curve_line(x, o); };
  for (int n = 0; n < kSteps; ++n) {
    Normal normal = gather(groups, x.size(), lines, scatter(groups, lines));
    normal.A.diagonal().array() *= 1 + 1e-9;
    normal.A.diagonal().array() += 1e-9;
    Eigen::VectorXd step = -normal.A.ldlt().solve(normal.b);
    for (int halved = 0; halved < 20 && !rises(x + step); ++halved) step /= 2;
    if (!rises(x + step)) break;
    x += step;
    if (step.cwiseAbs().maxCoeff() < kStill) break;
  }
  const double scale = scatter(groups, lines);
  const Normal normal = gather(groups, x.size(), lines, scale);
  return {x, scale, x.size() == 1 && normal.A(0, 0) > 0 ? 1 / std::sqrt(normal.A(0, 0)) : 0};
}

}  // namespace

Disagreement disagreement(const LightGroups& groups, const LightModel& model) {
  Disagreement result{0, std::vector<double>(model.response.size(), 0.0)};
  std::vector<double> weights(model.response.size(), 0.0);
  double square = 0, weight = 0;
  const auto lines = [&](const Observation& o) { return Linear{log_light(model, o), {}, {}, 0}; };
  each_group(groups, lines, [&](std::size_t first, const Lines& seen, const Numbers& apart) {
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const Observation& o = groups.all[first + i];
      const double part = o.weight * apart[i] * apart[i];
      square += part;
      weight += o.weight;
      result.head_rms[static_cast<std::size_t>(o.head)] += part;
      weights[static_cast<std::size_t>(o.head)] += o.weight;
    }
  });
  result.rms = weight > 0 ? std::sqrt(square / weight) : 0;
  for (std::size_t h = 0; h < weights.size(); ++h) {
    result.head_rms[h] = weights[h] > 0 ? std::sqrt(result.head_rms[h] / weights[h]) : 0;
  }
  return result;
}

ResponseFit fit_response(const LightGroups& same_places) {
  const CurveFit gamma = descend_curve(same_places, Eigen::VectorXd::Constant(1, 2.0));
  const CurveFit polynomial = descend_curve(same_places, Eigen::Vector3d(0.8, 0.05, 0.05));
  const bool bend = polynomial.rms < kClearly * gamma.rms;
  ResponseFit fit;
  fit.response = curve_of(bend ? polynomial.x : gamma.x);
  fit.sigma_gamma = bend ? 0 : gamma.sigma;
  LightModel model;
  model.response.assign(kMaxHeads, fit.response);
  model.log_gain.resize(kMaxHeads);
  model.vignetting.resize(kMaxHeads);
  fit.rms = disagreement(same_places, model).rms;
  return fit;
}

namespace {

/// Where a head's numbers stand among the unknowns: three gains a head, then three of fall-off, for all or a head.
struct Places {
  std::size_t heads;
  bool own;
  Eigen::Index count() const { return static_cast<Eigen::Index>(3 * heads + (own ? 3 * heads : 3)); }
  Eigen::Index gain(std::size_t head, int channel) const { return static_cast<Eigen::Index>(3 * head) + channel; }
  Eigen::Index fall(std::size_t head) const { return static_cast<Eigen::Index>(3 * heads + (own ? 3 * head : 0)); }
};

Linear gain_line(const LightModel& model, const Places& places, const Observation& o) {
  const auto h = static_cast<std::size_t>(o.head);
  const double fall = std::max(fall_off(model.vignetting[h], o.s), kLeastFall);
  Linear line;
  line.log_light = log_light(model, o);
  line.add(places.gain(h, o.channel), -1);
  double power = o.s;
  for (Eigen::Index k = 0; k < 3; ++k, power *= o.s) line.add(places.fall(h) + k, -power / fall);
  return line;
}

/// Adds what the overlaps do not say: the mean of the gains, and a loose wish for no fall-off.
void hold(const LightModel& model, const LightModel& start, const LightFreedom& freedom, const Places& places,
          Normal& normal) {
  for (int c = 0; c < 3; ++c) {
    double off = 0;
    for (std::size_t h = 0; h < places.heads; ++h) {
      if (!freedom.placed[h]) continue;
      const auto channel = static_cast<std::size_t>(c);
      off += model.log_gain[h][channel] - start.log_gain[h][channel];
      for (std::size_t other = 0; other < places.heads; ++other) {
        if (freedom.placed[other]) normal.A(places.gain(h, c), places.gain(other, c)) += kHeld;
      }
    }
    for (std::size_t h = 0; h < places.heads; ++h) {
      if (freedom.placed[h]) normal.b[places.gain(h, c)] += kHeld * off;
      else normal.A(places.gain(h, c), places.gain(h, c)) += kHeld;  // nothing pulls it: it stays
    }
  }
  for (std::size_t h = 0; h < (places.own ? places.heads : 1); ++h) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      normal.A(places.fall(h) + k, places.fall(h) + k) += kLoosely;
      normal.b[places.fall(h) + k] += kLoosely * model.vignetting[h][static_cast<std::size_t>(k)];
    }
  }
}

LightModel moved(const LightModel& from, const Places& places, const Eigen::VectorXd& step) {
  LightModel next = from;
  for (std::size_t h = 0; h < places.heads; ++h) {
    for (int c = 0; c < 3; ++c) next.log_gain[h][static_cast<std::size_t>(c)] += step[places.gain(h, c)];
    for (Eigen::Index k = 0; k < 3; ++k) next.vignetting[h][static_cast<std::size_t>(k)] += step[places.fall(h) + k];
  }
  return next;
}

bool falls_gently(const LightModel& model) {
  for (const auto& v : model.vignetting) {
    for (const double s : {0.25, 0.5, 0.75, 1.0}) {
      if (!(fall_off(v, s) > kLeastFall)) return false;
    }
  }
  return true;
}

}  // namespace

LightFit fit_gains(const LightGroups& shared_rays, const LightModel& start, const LightFreedom& freedom) {
  const Places places{start.response.size(), freedom.own_vignetting};
  LightFit fit{start, {}, {}};
  LightModel& model = fit.model;
  const auto lines = [&](const Observation& o) { return gain_line(model, places, o); };
  for (int n = 0; n < kSteps; ++n) {
    Normal normal = gather(shared_rays, places.count(), lines, scatter(shared_rays, lines));
    hold(model, start, freedom, places, normal);
    Eigen::VectorXd step = -normal.A.ldlt().solve(normal.b);
    for (int halved = 0; halved < 20 && !falls_gently(moved(model, places, step)); ++halved) step /= 2;
    if (!falls_gently(moved(model, places, step))) break;
    model = moved(model, places, step);
    if (step.cwiseAbs().maxCoeff() < kStill) break;
  }
  Normal normal = gather(shared_rays, places.count(), lines, scatter(shared_rays, lines));
  hold(model, start, freedom, places, normal);
  const Eigen::MatrixXd C = normal.A.ldlt().solve(Eigen::MatrixXd::Identity(places.count(), places.count()));
  for (std::size_t h = 0; h < places.heads; ++h) {
    std::array<double, 3> sigma{};
    for (int c = 0; c < 3; ++c) {
      sigma[static_cast<std::size_t>(c)] = std::sqrt(std::max(0.0, C(places.gain(h, c), places.gain(h, c))));
    }
    fit.sigma_log_gain.push_back(sigma);
    const double variance = C.block<3, 3>(places.fall(h), places.fall(h)).sum();
    fit.sigma_corner.push_back(std::sqrt(std::max(0.0, variance)) / fall_off(model.vignetting[h], 1));
  }
  return fit;
}

}  // namespace nodal::calibration
