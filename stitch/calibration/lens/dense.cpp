#include "stitch/calibration/lens/dense.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "stitch/solve/robust.h"

namespace nodal::calibration {
namespace {

constexpr int kBands = 24;                // bands of rows; fixed, so that sums do not depend on the threads
constexpr solve::Huber kPixelHuber{2.0};  // standard deviations of the residuals
constexpr int kShadeStride = 3;           // shading is smooth: every third pixel of a row suffices
constexpr double kPixelVariance = 1.0 / 12;
constexpr int kSmallestSide = 90;  // px, of the coarsest pyramid level
constexpr int kMaxTaps = 9;
constexpr double kCalm = 0.05;  // share of the pattern's range, per doubling of the blur
constexpr int kRounds = 12;

double binomial(int n, int k) {
  double value = 1;
  for (int i = 0; i < k; ++i) value = value * (n - i) / (i + 1);
  return value;
}

/// The longer axis of the ellipse with covariance S; `larger` is S's larger eigenvalue.
Eigen::Vector2d long_axis(const Eigen::Matrix2d& S, double larger) {
  const Eigen::Vector2d axis(S(0, 1), larger - S(0, 0));
  if (axis.squaredNorm() > 0) return axis.normalized();
  return S(0, 0) >= S(1, 1) ? Eigen::Vector2d::UnitX() : Eigen::Vector2d::UnitY();
}

/// The pattern's value in one pixel. A Gaussian in the photograph is an ellipse on the pattern; it is sampled along its
/// longer axis with binomial weights, whose variance for n samples one step apart is (n - 1) / 4 steps squared.
ScaleSpace::Sample through_footprint(const ScaleSpace& pattern, const Eigen::Vector2d& at,
                                     const Eigen::Matrix2d& footprint, double sigma) {
  const Eigen::Matrix2d S = footprint * footprint.transpose();
  const double half = (S(0, 0) + S(1, 1)) / 2;
  const double skew = (S(0, 0) - S(1, 1)) / 2;
  const double root = std::sqrt(skew * skew + S(0, 1) * S(0, 1));
  const double long2 = half + root;
  const double short2 = std::max(half - root, 1e-6 * long2);
  const double narrow = sigma * std::sqrt(short2);
  const double stretch = long2 / short2 - 1;
  const int taps = std::min(kMaxTaps, 1 + 2 * static_cast<int>(std::floor(0.8 * stretch + 0.6)));
  if (taps == 1) return pattern.at(at.x(), at.y(), sigma * std::sqrt(std::sqrt(long2 * short2)));
  const Eigen::Vector2d step = long_axis(S, long2) * sigma * std::sqrt(4 * (long2 - short2) / (taps - 1));
  ScaleSpace::Sample sum;
  const double whole = std::ldexp(1.0, taps - 1);
  for (int k = 0; k < taps; ++k) {
    const double weight = binomial(taps - 1, k) / whole;
    const Eigen::Vector2d place = at + step * (k - (taps - 1) / 2);
    const ScaleSpace::Sample s = pattern.at(place.x(), place.y(), narrow);
    sum.value += weight * s.value;
    sum.dx += weight * s.dx;
    sum.dy += weight * s.dy;
    sum.dscale += weight * s.dscale;
  }
  return sum;
}

}  // namespace

/// The constants of one photograph's pose and blur, computed once for many pixels.
struct DenseAlignment::Look {
  PlaneFinder plane;
  double sigma;        // standard deviation of the total blur, px of the level
  double by_log_blur;  // d(log2 of sigma) / d(log_blur)

  Look(const Pose& pose, double log_blur, int level) : plane(pose) {
    // Halving a picture blurs it too; `variance` is that of a level, in its own pixels.
    double own = std::exp(2 * log_blur);
    double variance = own + kPixelVariance;
    for (int l = 0; l < level; ++l) {
      variance = (variance + 3 * kLevelSigma * kLevelSigma) / 4;
      own /= 4;
    }
    sigma = std::sqrt(variance);
    by_log_blur = own / variance / std::numbers::ln2;
  }
};

/// One pixel of one photograph, with the pattern's value there.
struct DenseAlignment::Seen {
  geometry::Pixel pixel;       // position in the full-size photograph
  double x = 0, y = 0;         // the same, scaled to -1..1
  double value = 0;            // the photograph's value
  ScaleSpace::Sample pattern;  // derivatives are per px of the pattern
  PlanePoint point;
  const Sight* sight = nullptr;
  double dlog_blur = 0;  // d(pattern's value) / d(log_blur)
};

DenseAlignment::DenseAlignment(const ScaleSpace& pattern, const std::vector<GreyImage>& photos, Region region,
                               solve::ForEach for_each)
    : pattern_(pattern), region_(region), for_each_(std::move(for_each)), shadings_(photos.size()) {
  for (const GreyImage& photo : photos) {
    std::vector<GreyImage> pyramid{photo};
    while (std::min(pyramid.back().width, pyramid.back().height) >= 2 * kSmallestSide) {
      pyramid.push_back(halved(pyramid.back()));
    }
    pyramids_.push_back(std::move(pyramid));
  }
}

void DenseAlignment::set_level(int level, long most_pixels) {
  level_ = level;
  const GreyImage& image = pyramids_[0][static_cast<std::size_t>(level)];
  const double pixels = static_cast<double>(image.width) * image.height * static_cast<double>(pyramids_.size());
  stride_ = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / static_cast<double>(most_pixels)))));
}

bool DenseAlignment::see(const Look& look, const Sight& sight, Seen& seen) const {
  const auto point = look.plane.at(sight.ray);
  if (!point) return false;
  const GreyImage& base = pattern_.level(0);
  const double width = base.width;
  const double px = std::ldexp(1.0, level_);  // px of the full photograph per pixel of this level
  const Eigen::Matrix2d footprint = width * px * point->distance * point->by_move * sight.by_pixel;
  const Eigen::Vector2d at(point->at.x() * width + width / 2, point->at.y() * width + base.height / 2.0);
  const Eigen::Vector2d reach = 2.5 * look.sigma * footprint.rowwise().norm();
  if (at.x() < reach.x() || at.y() < reach.y() || at.x() > width - reach.x() || at.y() > base.height - reach.y()) {
    return false;
  }
  seen.pattern = through_footprint(pattern_, at, footprint, look.sigma);
  seen.point = *point;
  seen.sight = &sight;
  seen.dlog_blur = seen.pattern.dscale * look.by_log_blur;
  return true;
}

bool DenseAlignment::in_region(const geometry::Pixel& pixel, double margin) const {
  if (pixel.x < region_.left + margin || pixel.x > region_.right - margin || pixel.y < region_.top + margin ||
      pixel.y > region_.bottom - margin) {
    return false;
  }
  return !region_.circle ||
         std::hypot(pixel.x - region_.circle->x, pixel.y - region_.circle->y) <= region_.circle->radius - margin;
}

void DenseAlignment::gather(const DenseState& state, int band,
                            const std::function<void(std::size_t view, const Seen&)>& take, int every) const {
  const SightFinder lens(state.arrangement.lens);
  std::vector<Look> looks;
  for (std::size_t v = 0; v < pyramids_.size(); ++v) {
    looks.emplace_back(state.arrangement.poses[v], state.log_blur[v], level_);
  }
  const auto level = static_cast<std::size_t>(level_);
  const GreyImage& first = pyramids_[0][level];
  const double px = std::ldexp(1.0, level_);
  const double margin = level_ == 0 ? 1 : 2 * px;
  const int rows = (first.height + stride_ - 1) / stride_;
  Seen seen;
  for (int n = band * rows / kBands; n < (band + 1) * rows / kBands; ++n) {
    const int j = n * stride_;
    // Rows start at different columns, so that the stride does not leave out whole columns.
    for (int i = (n * 7) % (stride_ * every); i < first.width; i += stride_ * every) {
      seen.pixel = {(i + 0.5) * px, (j + 0.5) * px};
      if (!in_region(seen.pixel, margin)) continue;
      const auto sight = lens.at(seen.pixel);
      if (!sight) continue;
      seen.x = 2 * seen.pixel.x / (px * first.width) - 1;
      seen.y = 2 * seen.pixel.y / (px * first.height) - 1;
      for (std::size_t v = 0; v < pyramids_.size(); ++v) {
        if (!see(looks[v], *sight, seen)) continue;
        seen.value = static_cast<double>(pyramids_[v][level].row(j)[i]);
        take(v, seen);
      }
    }
  }
}

void DenseAlignment::fit_shading(const DenseState& state) {
  const std::size_t views = pyramids_.size();
  std::vector<std::vector<std::vector<ShadeSample>>> bands(kBands, std::vector<std::vector<ShadeSample>>(views));
  for_each_(kBands, [&](int band) {
    const auto keep = [&](std::size_t v, const Seen& s) {
      bands[static_cast<std::size_t>(band)][v].push_back({static_cast<float>(s.x), static_cast<float>(s.y),
                                                          static_cast<float>(s.pattern.value),
                                                          static_cast<float>(s.value)});
    };
    gather(state, band, keep, kShadeStride);
  });
  std::vector<std::vector<ShadeSample>> samples(views);
  for (std::size_t v = 0; v < views; ++v) {
    for (const auto& band : bands) samples[v].insert(samples[v].end(), band[v].begin(), band[v].end());
  }
  shadings_.fit(samples);
}

solve::Evaluation DenseAlignment::evaluate(const DenseState& state) const {
  const int views = static_cast<int>(pyramids_.size());
  const int shared = state.arrangement.lens.count;
  const double width = pattern_.level(0).width;
  const solve::Evaluation zero{solve::NormalEquations(shared, kOwn, views)};
  solve::Evaluation total = solve::sum_of_pieces(kBands, zero, for_each_, [&](int band, solve::Evaluation& sum) {
    gather(state, band, [&](std::size_t v, const Seen& s) {
      const Shadings::Shown shown = shadings_.at(v, s.x, s.y, s.pattern.value);
      const double residual = shown.value - s.value;
      const Eigen::RowVector2d slope = shown.slope * width * Eigen::RowVector2d(s.pattern.dx, s.pattern.dy);
      const Eigen::Vector3d g = (slope * s.point.by_move).transpose();
      const Eigen::Matrix<double, 1, kMaxLensParameters> by_shared =
          s.point.distance * g.transpose() * s.sight->by_parameter;
      Eigen::Matrix<double, 1, kOwn> by_own;
      by_own << g.cross(s.point.in_head).transpose(), -g.transpose(), shown.slope * s.dlog_blur;
      // Dividing by the standard deviation of its residuals makes photographs with different noise comparable; Huber's
      // norm limits the effect of outliers.
      const double scale = 1 / shadings_.scatter(v);
      const double size = std::abs(residual) * scale;
      const double weight = kPixelHuber.weight(size);
      sum.equations.add(static_cast<int>(v), by_shared.data(), by_own.data(), residual, weight * scale * scale);
      sum.cost += kPixelHuber.cost(size);
    });
  });
  // The cost is a mean: a sum would fall when a photograph moves off the pattern and has fewer pixels.
  if (total.equations.count() > 0) total.cost /= static_cast<double>(total.equations.count());
  else total.cost = solve::kImpossible;
  return total;
}

solve::Evaluation DenseAlignment::run(int level, const Care& care, const std::vector<bool>& fixed_lens,
                                      DenseState& state) {
  set_level(level, care.most_pixels);
  std::vector<bool> fixed = fixed_lens;
  fixed.resize(static_cast<std::size_t>(state.arrangement.lens.count) + kOwn * pyramids_.size(), false);
  const auto step = [](const DenseState& from, const Eigen::VectorXd& d) {
    DenseState next = from;
    next.arrangement = moved(from.arrangement, d, kOwn);
    for (std::size_t v = 0; v < next.log_blur.size(); ++v) {
      const auto at = next.arrangement.lens.count + static_cast<Eigen::Index>(v) * kOwn + kOwn - 1;
      next.log_blur[v] = std::clamp(next.log_blur[v] + std::clamp(d[at], -0.5, 0.5), std::log(0.2), std::log(8.0));
    }
    return next;
  };
  for (int round = 1;; ++round) {
    fit_shading(state);
    auto descent =
        solve::descend(state, [this](const DenseState& s) { return evaluate(s); }, step, fixed,
                       {.most_steps = round == 1 ? 6 : 3, .enough = 0, .sure = care.sure, .first_damping = 1e-4});
    const double before = state.arrangement.lens[kFirstCoefficient];
    const double cx = state.arrangement.lens[kCenterX];
    state = descent.state;
    // The focal length is in px at 45 degrees or at one radian, so its change is a movement in the picture, like the
    // centre's.
    const double movement = std::max(std::abs(state.arrangement.lens[kFirstCoefficient] - before),
                                     std::abs(state.arrangement.lens[kCenterX] - cx));
    const bool still = round > 1 && movement < std::ldexp(care.still_px, level);
    if (still || round == kRounds) return std::move(descent.at);
  }
}

DenseSurvey DenseAlignment::survey(const DenseState& state) const {
  struct Sums {
    double n = 0, value = 0, square = 0, left = 0;
  };
  struct Band {
    std::vector<Sums> sums;
    std::vector<std::vector<LightSample>> calm;
    std::vector<bool> cells;
  };
  constexpr int kGrid = 64;
  const std::size_t views = pyramids_.size();
  const GreyImage& full = pyramids_[0][0];
  const GreyImage& image = pyramids_[0][static_cast<std::size_t>(level_)];
  const double px = std::ldexp(1.0, level_) * stride_;
  const auto cell = [&](const geometry::Pixel& p) {
    return static_cast<std::size_t>(static_cast<int>(p.y * kGrid / full.height) * kGrid +
                                    static_cast<int>(p.x * kGrid / full.width));
  };
  DenseSurvey survey;
  survey.residuals.resize(views, GreyImage(image.width / stride_ + 1, image.height / stride_ + 1));
  survey.calm.resize(views);
  std::vector<Band> bands(kBands, Band{std::vector<Sums>(views), survey.calm, std::vector<bool>(kGrid * kGrid)});
  for_each_(kBands, [&](int n) {
    Band& band = bands[static_cast<std::size_t>(n)];
    gather(state, n, [&](std::size_t v, const Seen& s) {
      const double left = s.value - shadings_.at(v, s.x, s.y, s.pattern.value).value;
      Sums& sum = band.sums[v];
      sum.n += 1;
      sum.value += s.value;
      sum.square += s.value * s.value;
      sum.left += left * left;
      band.cells[cell(s.pixel)] = true;
      // Bands have disjoint rows, so no lock is needed.
      survey.residuals[v].row(static_cast<int>(s.pixel.y / px))[static_cast<int>(s.pixel.x / px)] =
          static_cast<float>(left);
      if (std::abs(s.pattern.dscale) > kCalm * (s.pattern.value + kCalm)) return;
      band.calm[v].push_back({static_cast<int>(v), s.pixel.x, s.pixel.y, s.pattern.value, s.value});
    });
  });
  const double all = static_cast<double>(image.width) * image.height / (stride_ * stride_);
  for (std::size_t v = 0; v < views; ++v) {
    Sums sum;
    for (const Band& band : bands) {
      sum.n += band.sums[v].n;
      sum.value += band.sums[v].value;
      sum.square += band.sums[v].square;
      sum.left += band.sums[v].left;
      survey.calm[v].insert(survey.calm[v].end(), band.calm[v].begin(), band.calm[v].end());
    }
    DenseFit fit;
    if (sum.n > 0) {
      const double variance = sum.square / sum.n - (sum.value / sum.n) * (sum.value / sum.n);
      fit.rms = std::sqrt(sum.left / sum.n);
      fit.explained = variance > 0 ? 1 - sum.left / sum.n / variance : 0;
      fit.covered = sum.n / all;
    }
    survey.fits.push_back(fit);
  }
  int inside = 0;
  int seen = 0;
  const LensParameters& lens = state.arrangement.lens;
  constexpr std::size_t kRings = 32;
  std::array<int, kRings> ring_inside{}, ring_seen{};
  const double ring_px = std::hypot(full.width, full.height) / kRings;  // reaches every corner from any centre
  for (int j = 0; j < kGrid; ++j) {
    for (int i = 0; i < kGrid; ++i) {
      const geometry::Pixel p{(i + 0.5) / kGrid * full.width, (j + 0.5) / kGrid * full.height};
      if (!in_region(p, 0)) continue;
      const double r = std::hypot(p.x - lens[kCenterX], (p.y - lens[kCenterY]) / lens[kAspect]);
      const std::size_t ring = std::min(kRings - 1, static_cast<std::size_t>(r / ring_px));
      const int is = std::ranges::any_of(bands, [&](const Band& band) { return band.cells[cell(p)]; }) ? 1 : 0;
      ++inside;
      seen += is;
      ++ring_inside[ring];
      ring_seen[ring] += is;
    }
  }
  survey.covered = static_cast<double>(seen) / std::max(inside, 1);
  // A tenth of a ring shows how long the radius is; a few cells may be one corner of one photograph.
  const auto shown = [&](std::size_t ring) { return ring_seen[ring] > 0 && 10 * ring_seen[ring] >= ring_inside[ring]; };
  std::size_t first = 0;
  while (first < kRings && !shown(first)) ++first;
  std::size_t end = first;
  while (end < kRings && shown(end)) ++end;
  survey.seen_from_px = static_cast<double>(first) * ring_px;
  survey.seen_to_px = static_cast<double>(end) * ring_px;
  return survey;
}

Eigen::MatrixXd covariance(const solve::Evaluation& end, std::vector<bool> fixed_lens) {
  fixed_lens.resize(static_cast<std::size_t>(end.equations.size()), false);
  // Residuals are in units of their standard deviation. Model errors (print, blur) are correlated over a few
  // neighbouring pixels, so the number of independent residuals is smaller.
  constexpr double kAlike = 9;
  const double unit = end.equations.cost() / static_cast<double>(std::max(end.equations.count(), 1L));
  return end.equations.covariance(fixed_lens) * unit * kAlike;
}

}  // namespace nodal::calibration
