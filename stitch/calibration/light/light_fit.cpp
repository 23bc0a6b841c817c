#include "stitch/calibration/light/light_fit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>

#include "protocol/base/units.h"
#include "protocol/calibration_limits.h"
#include "stitch/geometry/lens/rising_polynomial.h"
#include "stitch/geometry/response.h"
#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/robust.h"

namespace nodal::calibration {
namespace {

constexpr solve::Huber kHuber{1.5};  // standard deviations
constexpr double kLoosely = 4;       // weight of "no fall-off" where the data do not determine the fall-off
constexpr double kHeld = 1e6;        // weight that holds an unknown that the data do not determine
constexpr double kMinLight = 1e-4;
constexpr double kMinFall = 0.02;
constexpr double kClearly = 0.85;  // a polynomial's rms must be below this share of the gamma curve's
constexpr std::size_t kMaxTerms = 4;

/// ln light of an observation, and its derivatives by the few unknowns on which it depends.
struct Linear {
  double log_light = 0;
  std::array<Eigen::Index, kMaxTerms> unknown{};
  std::array<double, kMaxTerms> slope{};
  std::size_t count = 0;

  std::ptrdiff_t terms() const { return static_cast<std::ptrdiff_t>(count); }
  void add(Eigen::Index which, double by) {
    unknown[count] = which;
    slope[count++] = by;
  }
};
using Linearize = std::function<Linear(const Observation&)>;
using Lines = std::vector<Linear>;

/// Calls `take` with the index of each group's first observation and its linearized observations.
template <class Take>
void each_group(const LightGroups& groups, const Linearize& linearize, Take&& take) {
  std::vector<Linear> lines;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    lines.clear();
    for (std::size_t i = groups.first[g]; i < groups.first[g + 1]; ++i) lines.push_back(linearize(groups.all[i]));
    take(groups.first[g], lines);
  }
}

/// The distance of each observation from its group's weighted mean.
std::vector<double> distances(const LightGroups& groups, const Linearize& linearize) {
  std::vector<double> apart(groups.all.size());
  each_group(groups, linearize, [&](std::size_t first, const Lines& lines) {
    double sum = 0, weight = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      sum += groups.all[first + i].weight * lines[i].log_light;
      weight += groups.all[first + i].weight;
    }
    for (std::size_t i = 0; i < lines.size(); ++i) apart[first + i] = lines[i].log_light - sum / weight;
  });
  return apart;
}

/// The weights of all observations under a model (lower for outliers), and the ratio of a typical residual to its
/// predicted standard deviation.
struct Weights {
  double scale = 1;
  std::vector<double> each;
};

Weights weights_at(const LightGroups& groups, const Linearize& linearize) {
  const std::vector<double> apart = distances(groups, linearize);
  std::vector<double> sizes;
  for (std::size_t i = 0; i < apart.size(); ++i) sizes.push_back(std::abs(apart[i]) * std::sqrt(groups.all[i].weight));
  Weights weights;
  std::vector<double> sorted = sizes;
  if (!sorted.empty()) weights.scale = std::max(solve::kSigmaPerMedian * solve::median(sorted), 1e-6);
  for (std::size_t i = 0; i < apart.size(); ++i) {
    const double own = groups.all[i].weight / (weights.scale * weights.scale);
    weights.each.push_back(own * kHuber.weight(sizes[i] / weights.scale));
  }
  return weights;
}

/// The normal equations of all distances to the groups' weighted means; this eliminates each group's own light.
solve::Evaluation sum_of(const LightGroups& groups, Eigen::Index unknowns, const Linearize& linearize,
                         const std::vector<double>& weights) {
  solve::Evaluation sum{solve::NormalEquations(static_cast<int>(unknowns))};
  std::vector<Eigen::Index> at;  // the unknowns on which a group depends
  std::vector<double> mean, row;
  each_group(groups, linearize, [&](std::size_t first, const Lines& lines) {
    at.clear();
    for (const Linear& line : lines) at.insert(at.end(), line.unknown.begin(), line.unknown.begin() + line.terms());
    std::ranges::sort(at);
    at.erase(std::unique(at.begin(), at.end()), at.end());
    const auto place_of = [&](Eigen::Index unknown) {
      return static_cast<std::size_t>(std::ranges::lower_bound(at, unknown) - at.begin());
    };
    double weight = 0, log_light = 0;
    mean.assign(at.size(), 0);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const double own = weights[first + i];
      weight += own;
      log_light += own * lines[i].log_light;
      for (std::size_t k = 0; k < lines[i].count; ++k) mean[place_of(lines[i].unknown[k])] += own * lines[i].slope[k];
    }
    for (double& each : mean) each /= weight;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      row.clear();
      for (const double each : mean) row.push_back(-each);
      for (std::size_t k = 0; k < lines[i].count; ++k) row[place_of(lines[i].unknown[k])] += lines[i].slope[k];
      sum.equations.add(at, row, lines[i].log_light - log_light / weight, weights[first + i]);
    }
  });
  return sum;
}

constexpr solve::DescentOptions kDescent{
    .most_steps = 60, .enough = 1e-14, .first_damping = 1e-9, .least_damping = 1e-9};

/// moved(state, step), with the step halved until the state is valid. Increasing the damping instead would turn the
/// step towards the border of the valid states, and the descent would end there.
template <class State, class Move, class Possible>
State moved_within(const State& from, Eigen::VectorXd step, Move&& moved, Possible&& possible) {
  constexpr int kMaxHalvings = 20;
  for (int halved = 0; halved < kMaxHalvings && !possible(moved(from, step)); ++halved) step /= 2;
  return moved(from, step);
}

double fall_off(const std::array<double, 3>& v, double s) { return 1 + s * (v[0] + s * (v[1] + s * v[2])); }

/// ln decode(value), limited below, because the logarithm of almost no light is meaningless.
double log_decoded(const Response& response, double value) {
  return std::log(std::max(geometry::decode(response, value), kMinLight));
}

/// The curve with unknowns x: 1 / gamma alone, or c2, c3, c4 of a polynomial (the coefficients sum to one).
Response curve_of(const Eigen::VectorXd& x) {
  Response response;
  if (x.size() == 1) {
    response.curve = Response::Curve::kGamma;
    response.gamma = 1 / x[0];
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

/// A gamma curve is fitted to logarithms of values, whose noise does not depend on gamma. Fitted to those of light,
/// noise would be multiplied by gamma, and the fit would prefer small ones.
Linear curve_line(const Eigen::VectorXd& x, const Observation& o) {
  Linear line;
  const double e = o.value;
  if (x.size() == 1) {
    line.log_light = std::log(e) - x[0] * std::log(2.0) * o.stops;
    line.add(0, -std::log(2.0) * o.stops);
    return line;
  }
  double light = e;
  for (Eigen::Index k = 0; k < x.size(); ++k) light += x[k] * (std::pow(e, k + 2) - e);
  light = std::max(light, kMinLight);
  line.log_light = std::log(light) - std::log(2.0) * o.stops;
  for (Eigen::Index k = 0; k < x.size(); ++k) line.add(k, (std::pow(e, k + 2) - e) / light);
  return line;
}

/// The curve fitted from x, its residuals in units of `scale`, and x's covariance.
struct CurveFit {
  Eigen::VectorXd x;
  double rms = 0;
  double sigma = 0;
};

CurveFit descend_curve(const LightGroups& groups, const Eigen::VectorXd& start) {
  const auto lines_of = [](const Eigen::VectorXd& x) {
    return [&x](const Observation& o) { return curve_line(x, o); };
  };
  Weights weights;
  const auto end = solve::descend_reweighted(
      start,
      [&](const Eigen::VectorXd& x) {
        if (!rises(x)) return solve::Evaluation{solve::NormalEquations(0), solve::kImpossible};
        solve::Evaluation sum = sum_of(groups, x.size(), lines_of(x), weights.each);
        sum.cost = sum.equations.cost();
        return sum;
      },
      [](const Eigen::VectorXd& x, const Eigen::VectorXd& step) {
        const auto added = [](const Eigen::VectorXd& from, const Eigen::VectorXd& by) {
          return Eigen::VectorXd(from + by);
        };
        return moved_within(x, step, added, rises);
      },
      [&](const Eigen::VectorXd& x) { weights = weights_at(groups, lines_of(x)); }, kDescent);
  const double information = end.state.size() == 1 ? end.at.equations.matrix()(0, 0) : 0;
  return {end.state, weights.scale, information > 0 ? 1 / std::sqrt(information) : 0};
}

}  // namespace

LightModel model_of(const Calibration& calibration) {
  LightModel model;
  for (const HeadCalibration& head : calibration.heads) {
    model.response.push_back(head.response);
    model.log_gain.push_back({std::log(head.gain[0]), std::log(head.gain[1]), std::log(head.gain[2])});
    // The same curve, expressed over the radius that the fit uses for all heads, around the lens's centre.
    const double scale = std::pow(fall_off_radius(head) / head.vignetting.radius, 2);
    const auto& v = head.vignetting.coefficients;
    model.vignetting.push_back({v[0] * scale, v[1] * scale * scale, v[2] * scale * scale * scale});
  }
  return model;
}

double log_light(const LightModel& model, const Observation& o) {
  const auto h = static_cast<std::size_t>(o.head);
  return log_decoded(model.response[h], o.value) - model.log_gain[h][static_cast<std::size_t>(o.channel)] -
         std::log(std::max(fall_off(model.vignetting[h], o.s), kMinFall)) - std::log(2.0) * o.stops;
}

Disagreement disagreement(const LightGroups& groups, const LightModel& model) {
  Disagreement result{0, std::vector<double>(model.response.size(), 0.0)};
  std::vector<double> weights(model.response.size(), 0.0);
  double square = 0, weight = 0;
  const auto lines = [&](const Observation& o) { return Linear{log_light(model, o), {}, {}, 0}; };
  const std::vector<double> apart = distances(groups, lines);
  for (std::size_t i = 0; i < apart.size(); ++i) {
    const Observation& o = groups.all[i];
    const double part = o.weight * apart[i] * apart[i];
    square += part;
    weight += o.weight;
    result.head_rms[static_cast<std::size_t>(o.head)] += part;
    weights[static_cast<std::size_t>(o.head)] += o.weight;
  }
  result.rms = weight > 0 ? std::sqrt(square / weight) : 0;
  for (std::size_t h = 0; h < weights.size(); ++h) {
    result.head_rms[h] = weights[h] > 0 ? std::sqrt(result.head_rms[h] / weights[h]) : 0;
  }
  return result;
}

ResponseFit fit_response(const LightGroups& same_places) {
  const CurveFit power = descend_curve(same_places, Eigen::VectorXd::Constant(1, 0.5));
  const CurveFit polynomial = descend_curve(same_places, Eigen::Vector3d(0.8, 0.05, 0.05));
  const double gamma = 1 / power.x[0];
  const bool bend = polynomial.rms < kClearly * gamma * power.rms;
  ResponseFit fit;
  fit.response = curve_of(bend ? polynomial.x : power.x);
  fit.sigma_gamma = bend ? 0 : power.sigma * gamma * gamma;
  LightModel model;
  model.response.assign(kMaxCalibratedHeads, fit.response);
  model.log_gain.resize(kMaxCalibratedHeads);
  model.vignetting.resize(kMaxCalibratedHeads);
  fit.rms = disagreement(same_places, model).rms;
  return fit;
}

namespace {

/// The indices of a head's unknowns: three gains per head, then three fall-off coefficients, common or per head.
struct Places {
  std::size_t heads;
  bool own;
  Eigen::Index count() const { return static_cast<Eigen::Index>(3 * heads + (own ? 3 * heads : 3)); }
  Eigen::Index gain(std::size_t head, int channel) const { return static_cast<Eigen::Index>(3 * head) + channel; }
  Eigen::Index fall(std::size_t head) const { return static_cast<Eigen::Index>(3 * heads + (own ? 3 * head : 0)); }
};

Linear gain_line(const LightModel& model, const Places& places, const Observation& o) {
  const auto h = static_cast<std::size_t>(o.head);
  const double fall = std::max(fall_off(model.vignetting[h], o.s), kMinFall);
  Linear line;
  line.log_light = log_light(model, o);
  line.add(places.gain(h, o.channel), -1);
  double power = o.s;
  for (Eigen::Index k = 0; k < 3; ++k, power *= o.s) line.add(places.fall(h) + k, -power / fall);
  return line;
}

/// Adds constraints for what overlaps do not determine: the mean gain is kept; the fall-off tends to none.
void hold(const LightModel& model, const LightModel& start, const LightFreedom& freedom, const Places& places,
          solve::NormalEquations& sum) {
  std::vector<double> ones;
  std::vector<Eigen::Index> gains;
  const auto hold_one = [&](Eigen::Index unknown, double residual, double weight) {
    const double one = 1;
    sum.add(std::span(&unknown, 1), std::span(&one, 1), residual, weight);
  };
  for (int c = 0; c < 3; ++c) {
    const auto channel = static_cast<std::size_t>(c);
    double off = 0;
    gains.clear();
    for (std::size_t h = 0; h < places.heads; ++h) {
      if (!freedom.placed[h]) {
        hold_one(places.gain(h, c), 0, kHeld);
        continue;
      }
      off += model.log_gain[h][channel] - start.log_gain[h][channel];
      gains.push_back(places.gain(h, c));
    }
    ones.assign(gains.size(), 1);
    sum.add(gains, ones, off, kHeld);
  }
  for (std::size_t h = 0; h < (places.own ? places.heads : 1); ++h) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      hold_one(places.fall(h) + k, model.vignetting[h][static_cast<std::size_t>(k)], kLoosely);
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
      if (!(fall_off(v, s) > kMinFall)) return false;
    }
  }
  return true;
}

}  // namespace

LightFit fit_gains(const LightGroups& shared_rays, const LightModel& start, const LightFreedom& freedom) {
  const Places places{start.response.size(), freedom.own_vignetting};
  const auto lines_of = [&](const LightModel& model) {
    return [&](const Observation& o) { return gain_line(model, places, o); };
  };
  Weights weights;
  auto end = solve::descend_reweighted(
      start,
      [&](const LightModel& model) {
        if (!falls_gently(model)) return solve::Evaluation{solve::NormalEquations(0), solve::kImpossible};
        solve::Evaluation sum = sum_of(shared_rays, places.count(), lines_of(model), weights.each);
        hold(model, start, freedom, places, sum.equations);
        sum.cost = sum.equations.cost();
        return sum;
      },
      [&](const LightModel& from, const Eigen::VectorXd& step) {
        const auto by = [&](const LightModel& model, const Eigen::VectorXd& part) {
          return moved(model, places, part);
        };
        return moved_within(from, step, by, falls_gently);
      },
      [&](const LightModel& model) { weights = weights_at(shared_rays, lines_of(model)); }, kDescent);
  const Eigen::MatrixXd C = end.at.equations.covariance({});
  LightFit fit{std::move(end.state), {}, {}};
  for (std::size_t h = 0; h < places.heads; ++h) {
    std::array<double, 3> sigma{};
    for (int c = 0; c < 3; ++c) {
      sigma[static_cast<std::size_t>(c)] = std::sqrt(std::max(0.0, C(places.gain(h, c), places.gain(h, c))));
    }
    fit.sigma_log_gain.push_back(sigma);
    const double variance = C.block<3, 3>(places.fall(h), places.fall(h)).sum();
    fit.sigma_corner.push_back(std::sqrt(std::max(0.0, variance)) / fall_off(fit.model.vignetting[h], 1));
  }
  return fit;
}

}  // namespace nodal::calibration
