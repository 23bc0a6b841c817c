#include "stitch/calibration/lens/features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "protocol/base/angles.h"
#include "stitch/calibration/lens/scale_space.h"

namespace nodal::calibration {
namespace {

constexpr int kScales = 3;           // per octave
constexpr double kFirstSigma = 1.6;  // px of the octave
constexpr float kMinContrast = 0.006F;
constexpr int kBorder = 8;  // px of the octave; no features closer to the edge
constexpr int kBins = 36;   // bins of the histogram of gradient directions
constexpr int kCells = 4;
constexpr std::size_t kCellBins = 8;
constexpr double kCellSide = 3.0;  // side of a descriptor's cell, in sigmas
constexpr int kProbes = 3 * (kCells + 1);
constexpr float kLargestEntry = 0.2F;
constexpr float kRatio = 0.85F;  // limit of best distance / second-best distance

struct Octave {
  std::vector<GreyImage> blurs;        // kScales + 3
  std::vector<GreyImage> differences;  // kScales + 2
};

Octave make_octave(GreyImage base) {
  Octave octave;
  octave.blurs.push_back(std::move(base));
  for (int s = 1; s < kScales + 3; ++s) {
    const double from = kFirstSigma * std::exp2(static_cast<double>(s - 1) / kScales);
    const double to = kFirstSigma * std::exp2(static_cast<double>(s) / kScales);
    octave.blurs.push_back(blurred(octave.blurs.back(), std::sqrt(to * to - from * from)));
    const GreyImage& a = octave.blurs[octave.blurs.size() - 2];
    const GreyImage& b = octave.blurs.back();
    GreyImage d(a.width, a.height);
    for (std::size_t i = 0; i < d.values.size(); ++i) d.values[i] = b.values[i] - a.values[i];
    octave.differences.push_back(std::move(d));
  }
  return octave;
}

bool is_extremum(const Octave& octave, std::size_t s, int i, int j) {
  const float v = octave.differences[s].row(j)[i];
  const float sign = v > 0 ? 1.0F : -1.0F;
  for (std::size_t level = s - 1; level <= s + 1; ++level) {
    for (int y = j - 1; y <= j + 1; ++y) {
      const float* row = octave.differences[level].row(y);
      for (int x = i - 1; x <= i + 1; ++x) {
        if ((level != s || y != j || x != i) && sign * row[x] >= sign * v) return false;
      }
    }
  }
  return true;
}

/// The extremum of the parabola through the neighbours, per axis; nothing on an edge without a corner.
std::optional<Eigen::Vector2d> refine(const GreyImage& d, int i, int j) {
  const auto at = [&](int x, int y) { return static_cast<double>(d.row(y)[x]); };
  const double gx = (at(i + 1, j) - at(i - 1, j)) / 2;
  const double gy = (at(i, j + 1) - at(i, j - 1)) / 2;
  const double xx = at(i + 1, j) + at(i - 1, j) - 2 * at(i, j);
  const double yy = at(i, j + 1) + at(i, j - 1) - 2 * at(i, j);
  const double xy = (at(i + 1, j + 1) + at(i - 1, j - 1) - at(i + 1, j - 1) - at(i - 1, j + 1)) / 4;
  const double det = xx * yy - xy * xy;
  constexpr double kEdge = 10;  // largest ratio of curvatures
  if (det <= 0 || (xx + yy) * (xx + yy) * kEdge > (kEdge + 1) * (kEdge + 1) * det) return std::nullopt;
  const Eigen::Vector2d offset(-(yy * gx - xy * gy) / det, -(xx * gy - xy * gx) / det);
  if (offset.cwiseAbs().maxCoeff() > 1) return std::nullopt;
  return offset;
}

struct Gradient {
  float size;
  float angle;
};
Gradient gradient(const GreyImage& image, int x, int y) {
  const float gx = image.row(y)[x + 1] - image.row(y)[x - 1];
  const float gy = image.row(y + 1)[x] - image.row(y - 1)[x];
  return {std::sqrt(gx * gx + gy * gy), std::atan2(gy, gx)};
}

/// The main gradient directions around a point: the strongest, and others nearly as strong.
std::vector<double> directions(const GreyImage& image, double x, double y, double sigma) {
  std::array<double, kBins> bins{};
  const double reach = 1.5 * sigma;
  const int radius = static_cast<int>(std::ceil(3 * reach));
  const int ci = static_cast<int>(x);
  const int cj = static_cast<int>(y);
  const auto weight = [reach](double d) { return std::exp(-d * d / (2 * reach * reach)); };
  const int first = std::max(1, ci - radius), last = std::min(image.width - 2, ci + radius);
  std::vector<double> across;
  for (int i = first; i <= last; ++i) across.push_back(weight(i + 0.5 - x));
  for (int j = std::max(1, cj - radius); j <= std::min(image.height - 2, cj + radius); ++j) {
    const double down = weight(j + 0.5 - y);
    for (int i = first; i <= last; ++i) {
      const Gradient g = gradient(image, i, j);
      const double bin = (static_cast<double>(g.angle) / (2 * kPi) + 1) * kBins;
      bins[static_cast<std::size_t>(bin) % kBins] +=
          down * across[static_cast<std::size_t>(i - first)] * static_cast<double>(g.size);
    }
  }
  for (int pass = 0; pass < 4; ++pass) {
    const std::array<double, kBins> old = bins;
    for (std::size_t b = 0; b < kBins; ++b) {
      bins[b] = (old[(b + kBins - 1) % kBins] + old[b] + old[(b + 1) % kBins]) / 3;
    }
  }
  const double peak = *std::ranges::max_element(bins);
  std::vector<double> found;
  for (std::size_t b = 0; b < kBins; ++b) {
    const double left = bins[(b + kBins - 1) % kBins];
    const double right = bins[(b + 1) % kBins];
    if (bins[b] < 0.8 * peak || bins[b] <= left || bins[b] < right) continue;
    const double shift = 0.5 * (left - right) / (left + right - 2 * bins[b]);
    found.push_back((static_cast<double>(b) + 0.5 + shift) / kBins * 2 * kPi);
  }
  return found;
}

/// A sampling point of a descriptor, in cells from its centre, and the weights of its gradient in the cells around it.
struct Probe {
  double u, v;
  struct Share {
    std::size_t cell;
    float weight;
  };
  std::vector<Share> shares;
};

/// Sampling points a third of a cell apart: blobs are blurred by that much, so denser points add little.
std::vector<Probe> make_probes() {
  std::vector<Probe> probes;
  const auto share = [](double place, int cell) {
    return std::max(0.0, 1 - std::abs(place - (cell - 0.5 * (kCells - 1))));
  };
  for (int row = 0; row < kProbes; ++row) {
    for (int column = 0; column < kProbes; ++column) {
      const double u = (column - 0.5 * (kProbes - 1)) / 3, v = (row - 0.5 * (kProbes - 1)) / 3;
      Probe probe{u, v, {}};
      const double middle = std::exp(-(u * u + v * v) / (0.5 * kCells * kCells));
      for (int cell = 0; cell < kCells * kCells; ++cell) {
        const double weight = middle * share(u, cell % kCells) * share(v, cell / kCells);
        if (weight > 0) probe.shares.push_back({static_cast<std::size_t>(cell), static_cast<float>(weight)});
      }
      probes.push_back(std::move(probe));
    }
  }
  return probes;
}

std::array<float, kDescriptorSize> describe(const GreyImage& image, double x, double y, double sigma, double angle) {
  static const std::vector<Probe> probes = make_probes();
  std::array<float, kDescriptorSize> bins{};
  const double c = kCellSide * sigma * std::cos(angle);
  const double s = kCellSide * sigma * std::sin(angle);
  for (const Probe& probe : probes) {
    const double px = x + c * probe.u - s * probe.v;
    const double py = y + s * probe.u + c * probe.v;
    if (px < 1 || py < 1 || px >= image.width - 1 || py >= image.height - 1) continue;
    const Gradient g = gradient(image, static_cast<int>(px), static_cast<int>(py));
    double direction = (static_cast<double>(g.angle) - angle) / (2 * kPi);
    direction = (direction - std::floor(direction)) * kCellBins;
    const auto below = static_cast<std::size_t>(direction);
    const auto above = static_cast<float>(direction - static_cast<double>(below));
    for (const Probe::Share& share : probe.shares) {
      float* cell = bins.data() + share.cell * kCellBins;
      cell[below % kCellBins] += g.size * share.weight * (1 - above);
      cell[(below + 1) % kCellBins] += g.size * share.weight * above;
    }
  }
  Eigen::Map<Eigen::Matrix<float, kDescriptorSize, 1>> vector(bins.data());
  vector.normalize();
  vector = vector.cwiseMin(kLargestEntry);  // limits the effect of one strong edge or a reflection
  vector.normalize();
  return bins;
}

struct Candidate {
  std::size_t octave;
  std::size_t scale;
  double x, y;  // px of the octave, pixel corners at integers
  float contrast;
};

void collect(const Octave& octave, std::size_t index, std::vector<Candidate>& candidates) {
  const int width = octave.blurs[0].width;
  const int height = octave.blurs[0].height;
  for (std::size_t s = 1; s <= kScales; ++s) {
    const GreyImage& d = octave.differences[s];
    for (int j = kBorder; j < height - kBorder; ++j) {
      const float* row = d.row(j);
      for (int i = kBorder; i < width - kBorder; ++i) {
        if (std::abs(row[i]) < kMinContrast || !is_extremum(octave, s, i, j)) continue;
        const auto offset = refine(d, i, j);
        if (!offset) continue;
        candidates.push_back({index, s, i + 0.5 + offset->x(), j + 0.5 + offset->y(), std::abs(row[i])});
      }
    }
  }
}

}  // namespace

Features find_features(const GreyImage& image, int most) {
  std::vector<Octave> octaves;
  GreyImage base = blurred(image, std::sqrt(kFirstSigma * kFirstSigma - 0.25));  // a photograph has its own 0.5 px
  while (std::min(base.width, base.height) >= 4 * kBorder) {
    octaves.push_back(make_octave(std::move(base)));
    const GreyImage& twice = octaves.back().blurs[kScales];  // its blur is kFirstSigma in the next octave's pixels
    base = GreyImage(twice.width / 2, twice.height / 2);
    for (int j = 0; j < base.height; ++j) {
      for (int i = 0; i < base.width; ++i) {
        const float* a = twice.row(2 * j) + 2 * i;
        const float* b = twice.row(2 * j + 1) + 2 * i;
        base.row(j)[i] = (a[0] + a[1] + b[0] + b[1]) / 4;
      }
    }
  }
  std::vector<Candidate> candidates;
  for (std::size_t o = 0; o < octaves.size(); ++o) collect(octaves[o], o, candidates);
  std::ranges::stable_sort(candidates, [](const Candidate& a, const Candidate& b) { return a.contrast > b.contrast; });
  if (candidates.size() > static_cast<std::size_t>(most)) candidates.resize(static_cast<std::size_t>(most));

  Features features;
  std::vector<std::array<float, kDescriptorSize>> rows;
  for (const Candidate& c : candidates) {
    const GreyImage& blur = octaves[c.octave].blurs[c.scale];
    const double sigma = kFirstSigma * std::exp2(static_cast<double>(c.scale) / kScales);
    const double px = std::ldexp(1.0, static_cast<int>(c.octave));
    for (const double angle : directions(blur, c.x, c.y, sigma)) {
      features.points.push_back({c.x * px, c.y * px, sigma * px, angle});
      rows.push_back(describe(blur, c.x, c.y, sigma, angle));
    }
  }
  features.descriptors.resize(kDescriptorSize, static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::ranges::copy(rows[i], features.descriptors.col(static_cast<Eigen::Index>(i)).begin());
  }
  return features;
}

std::vector<Match> match_features(const Features& photo, const Features& pattern) {
  std::vector<Match> matches;
  if (pattern.points.size() < 2) return matches;
  constexpr Eigen::Index kBlock = 256;
  for (Eigen::Index first = 0; first < photo.descriptors.cols(); first += kBlock) {
    const Eigen::Index count = std::min(kBlock, photo.descriptors.cols() - first);
    const Eigen::MatrixXf likeness = pattern.descriptors.transpose() * photo.descriptors.middleCols(first, count);
    for (Eigen::Index k = 0; k < count; ++k) {
      Eigen::Index best = 0;
      const float best_likeness = likeness.col(k).maxCoeff(&best);
      const Feature& found = pattern.points[static_cast<std::size_t>(best)];
      float second = -1;
      for (Eigen::Index n = 0; n < likeness.rows(); ++n) {
        if (likeness(n, k) <= second) continue;
        const Feature& other = pattern.points[static_cast<std::size_t>(n)];
        // The same blob with another direction, or at the next scale, does not count as second best.
        if (std::hypot(other.x - found.x, other.y - found.y) < 2 * std::max(found.sigma, other.sigma)) continue;
        second = likeness(n, k);
      }
      // |a - b|^2 = 2 - 2 a.b for vectors of length 1.
      if (1 - best_likeness < kRatio * kRatio * (1 - second)) {
        matches.push_back({static_cast<int>(first + k), static_cast<int>(best)});
      }
    }
  }
  return matches;
}

}  // namespace nodal::calibration
