#include "stitch/calibration/lens/shading.h"

#include <algorithm>
#include <cmath>

#include "stitch/solve/robust.h"
#include "stitch/solve/symmetric.h"

namespace nodal::calibration {
namespace {

constexpr int kPasses = 3;
constexpr double kFarOff = 2.0;      // standard deviations; residuals beyond it weigh less
constexpr double kStiffness = 1e-3;  // weight of the tone curve's second differences
constexpr double kMinRange = 0.05;   // smallest range of the tone curve; below it there is no contrast

/// The monomials x^i y^j of degree up to 4, in order of degree.
template <class Terms>
Terms monomials(double x, double y) {
  Terms terms;
  terms[0] = 1;
  Eigen::Index lower = 0;  // index of the first term of the previous degree
  for (Eigen::Index d = 1, at = 1; at < terms.size(); ++d) {
    for (Eigen::Index j = 0; j < d; ++j) terms[at + j] = terms[lower + j] * x;
    terms[at + d] = terms[lower + d - 1] * y;
    lower = at;
    at += d + 1;
  }
  return terms;
}

struct Knot {
  int index;
  double share;  // weight of the upper knot
};
Knot knot_of(double light, int knots) {
  const double u = std::clamp(light, 0.0, 1.0) * (knots - 1);
  const int k = std::min(static_cast<int>(u), knots - 2);
  return {k, u - k};
}

}  // namespace

struct Shadings::ToneSums {
  Eigen::Matrix<double, kKnots, kKnots> A = Eigen::Matrix<double, kKnots, kKnots>::Zero();
  Eigen::Matrix<double, kKnots, 1> b = Eigen::Matrix<double, kKnots, 1>::Zero();
};

Shadings::Shadings(std::size_t views) : shadings_(views), scatter_(views, 0.1) {
  for (int k = 0; k < kKnots; ++k) tone_[static_cast<std::size_t>(k)] = static_cast<double>(k) / (kKnots - 1);
}

double Shadings::tone(double light) const {
  const Knot k = knot_of(light, kKnots);
  const auto n = static_cast<std::size_t>(k.index);
  return tone_[n] + k.share * (tone_[n + 1] - tone_[n]);
}

Shadings::Shown Shadings::at(std::size_t view, double x, double y, double light) const {
  const Terms terms = monomials<Terms>(x, y);
  const double a = shadings_[view].a.dot(terms);
  const Knot k = knot_of(light, kKnots);
  const auto n = static_cast<std::size_t>(k.index);
  const double rise = tone_[n + 1] - tone_[n];
  return {a * (tone_[n] + k.share * rise) + shadings_[view].b.dot(terms.head<kTermsB>()), a * rise * (kKnots - 1)};
}

double Shadings::left_over(std::size_t view, const ShadeSample& s, const Terms& terms) const {
  return static_cast<double>(s.value) - shadings_[view].a.dot(terms) * tone(static_cast<double>(s.light)) -
         shadings_[view].b.dot(terms.head<kTermsB>());
}

void Shadings::fit_one(std::size_t view, const std::vector<ShadeSample>& samples) {
  constexpr int kTerms = kTermsA + kTermsB;
  Eigen::Matrix<double, kTerms, kTerms> A = Eigen::Matrix<double, kTerms, kTerms>::Zero();
  Eigen::Matrix<double, kTerms, 1> b = Eigen::Matrix<double, kTerms, 1>::Zero();
  for (const ShadeSample& s : samples) {
    const Terms terms = monomials<Terms>(static_cast<double>(s.x), static_cast<double>(s.y));
    // Outliers (an arm, a reflection) must not affect the fit; in the first round none are known.
    double weight = 1;
    if (fitted_) weight = std::min(1.0, kFarOff * scatter_[view] / std::max(std::abs(left_over(view, s, terms)), 1e-9));
    Eigen::Matrix<double, kTerms, 1> row;
    row << terms * tone(static_cast<double>(s.light)), terms.head<kTermsB>();
    A.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    b += weight * static_cast<double>(s.value) * row;
  }
  // A little regularization, for a photograph that shows the pattern in a corner only.
  A.diagonal().array() += 1e-6 * A(0, 0) + 1e-9;
  const Eigen::Matrix<double, kTerms, kTerms> full = A.selfadjointView<Eigen::Lower>();
  const Eigen::Matrix<double, kTerms, 1> x = solve::solve_symmetric(full, b, {}, {});
  shadings_[view].a = x.head<kTermsA>();
  shadings_[view].b = x.tail<kTermsB>();
}

void Shadings::add_tone(std::size_t view, const std::vector<ShadeSample>& samples, ToneSums& sums) {
  std::vector<double> off;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const ShadeSample& s = samples[i];
    const Terms terms = monomials<Terms>(static_cast<double>(s.x), static_cast<double>(s.y));
    const double left = left_over(view, s, terms);
    if (i % 8 == 0) off.push_back(std::abs(left));
    const double a = shadings_[view].a.dot(terms);
    const double wanted = left + a * tone(static_cast<double>(s.light));
    const double weight = a * std::min(1.0, kFarOff * scatter_[view] / std::max(std::abs(left), 1e-9));
    const Knot k = knot_of(static_cast<double>(s.light), kKnots);
    const double below = 1 - k.share;
    sums.A(k.index, k.index) += weight * a * below * below;
    sums.A(k.index, k.index + 1) += weight * a * below * k.share;
    sums.A(k.index + 1, k.index) += weight * a * below * k.share;
    sums.A(k.index + 1, k.index + 1) += weight * a * k.share * k.share;
    sums.b(k.index) += weight * wanted * below;
    sums.b(k.index + 1) += weight * wanted * k.share;
  }
  if (off.empty()) return;
  scatter_[view] = std::max(solve::kSigmaPerMedian * solve::median(off), 1e-4);
}

bool Shadings::fit_tone(ToneSums& sums) {
  // A knot with few pixels follows its neighbours.
  const double stiff = kStiffness * sums.A.trace() / kKnots + 1e-9;
  for (int k = 1; k + 1 < kKnots; ++k) {
    Eigen::Matrix<double, kKnots, 1> bend = Eigen::Matrix<double, kKnots, 1>::Zero();
    bend.segment<3>(k - 1) << 1, -2, 1;
    sums.A += stiff * bend * bend.transpose();
  }
  const Eigen::Matrix<double, kKnots, 1> knots = solve::solve_symmetric(sums.A, sums.b, {}, {});
  // A linear function can be moved between tone and shading; the convention is that the tone goes from 0 to 1.
  const double range = knots(kKnots - 1) - knots(0);
  if (!(range > kMinRange)) return false;
  for (int k = 0; k < kKnots; ++k) tone_[static_cast<std::size_t>(k)] = (knots(k) - knots(0)) / range;
  return true;
}

void Shadings::fit(const std::vector<std::vector<ShadeSample>>& samples) {
  for (int pass = 0; pass < kPasses; ++pass) {
    ToneSums sums;
    for (std::size_t v = 0; v < samples.size(); ++v) {
      fit_one(v, samples[v]);
      add_tone(v, samples[v], sums);
    }
    fitted_ = true;
    if (pass + 1 < kPasses && !fit_tone(sums)) break;
  }
}

}  // namespace nodal::calibration
