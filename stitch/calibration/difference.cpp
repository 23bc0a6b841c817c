#include "stitch/calibration/difference.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <optional>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/response.h"
#include "stitch/geometry/rotation.h"
#include "stitch/geometry/sampled_head.h"

namespace nodal::calibration {
namespace {

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

Result<Pairs> pair_heads(const Calibration& a, const Calibration& b, std::vector<std::string>& notes) {
  Pairs pairs;
  std::vector<bool> used(b.heads.size(), false);
  for (std::size_t i = 0; i < a.heads.size(); ++i) {
    for (std::size_t k = 0; k < b.heads.size(); ++k) {
      if (a.heads[i].name != b.heads[k].name) continue;
      pairs.emplace_back(i, k);
      used[k] = true;
    }
  }
  if (pairs.empty()) {
    if (a.heads.size() != b.heads.size()) {
      return fail(Errc::kHeadMismatch, fmt::format("the two calibrations have no head's name in common, and {} and {} "
                                                   "heads: they cannot be paired; rename the heads of one",
                                                   a.heads.size(), b.heads.size()));
    }
    notes.emplace_back("No head's name is in both: heads are paired by their order.");
    for (std::size_t i = 0; i < a.heads.size(); ++i) pairs.emplace_back(i, i);
    return pairs;
  }
  for (std::size_t i = 0; i < a.heads.size(); ++i) {
    const bool paired = std::ranges::any_of(pairs, [i](const auto& p) { return p.first == i; });
    if (!paired) notes.push_back("Head '" + a.heads[i].name + "' is only in the first.");
  }
  for (std::size_t k = 0; k < b.heads.size(); ++k) {
    if (!used[k]) notes.push_back("Head '" + b.heads[k].name + "' is only in the second.");
  }
  return pairs;
}

double angle_of(const Eigen::Matrix3d& R) {
  // By sine and cosine, which is accurate for small angles too.
  const Eigen::Vector3d axis(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  return std::atan2(axis.norm() / 2, (R.trace() - 1) / 2) / kRadiansPerDegree;
}

/// The rotation R_b_a of the rig for which R_head_b R_b_a is nearest to R_head_a; all heads have equal weight.
Eigen::Matrix3d best_turn(const std::vector<Eigen::Matrix3d>& a, const std::vector<Eigen::Matrix3d>& b) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) sum += b[i].transpose() * a[i];
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

struct Spread {
  double square = 0, most = 0;
  int count = 0;
  void add(double off) {
    square += off * off;
    most = std::max(most, off);
    ++count;
  }
  double rms() const { return count == 0 ? 0 : std::sqrt(square / count); }
};

/// The distances between the pixels that `a` and `b` give to the same rays: a's samples, rotated into b's head frame.
Spread distances(const std::vector<geometry::RayPixel>& samples, const geometry::Head& b,
                 const Eigen::Matrix3d& R_b_a) {
  Spread spread;
  for (const geometry::RayPixel& sample : samples) {
    const Eigen::Vector3d ray = b.R_head_rig().transpose() * (R_b_a * sample.ray);
    const auto pixel = b.project(geometry::Ray::towards(ray));
    if (pixel) spread.add(std::hypot(pixel->x - sample.pixel.x, pixel->y - sample.pixel.y));
  }
  return spread;
}

void compare_light(const geometry::Head& a, const geometry::Head& b, const std::vector<geometry::RayPixel>& samples,
                   HeadDifference& d) {
  for (const geometry::RayPixel& sample : samples) {
    const double stops =
        std::log2(std::max(b.vignetting(sample.pixel), 1e-6) / std::max(a.vignetting(sample.pixel), 1e-6));
    d.vignetting_stops = std::max(d.vignetting_stops, std::abs(stops));
  }
  for (int level = 0; level <= 255; ++level) {
    const double off = geometry::decode(a.calibration().response, level / 255.0) -
                       geometry::decode(b.calibration().response, level / 255.0);
    d.response_levels = std::max(d.response_levels, 255 * std::abs(off));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    d.gain_stops[k] = std::log2(b.calibration().gain[k] / a.calibration().gain[k]);
  }
}

/// A gain common to all heads is an exposure, not a difference.
void take_out_mean_gain(std::vector<HeadDifference>& heads) {
  double mean = 0;
  for (const HeadDifference& d : heads) {
    for (const double stops : d.gain_stops) mean += stops / (3 * static_cast<double>(heads.size()));
  }
  for (HeadDifference& d : heads) {
    for (double& stops : d.gain_stops) stops -= mean;
  }
}

}  // namespace

Result<RigDifference> difference_of(const Calibration& a, const Calibration& b) {
  const Result<std::vector<geometry::Head>> heads_a = geometry::make_heads(a);
  if (!heads_a) return fail(heads_a.error().in("the first"));
  const Result<std::vector<geometry::Head>> heads_b = geometry::make_heads(b);
  if (!heads_b) return fail(heads_b.error().in("the second"));
  RigDifference difference;
  NODAL_TRY_ASSIGN(const Pairs pairs, pair_heads(a, b, difference.notes));
  std::vector<Eigen::Matrix3d> Ra, Rb;
  for (const auto& [i, k] : pairs) {
    Ra.push_back((*heads_a)[i].R_head_rig());
    Rb.push_back((*heads_b)[k].R_head_rig());
  }
  const Eigen::Matrix3d R_b_a = best_turn(Ra, Rb);
  difference.rig_turn_deg = angle_of(R_b_a);
  Spread turned;
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    const geometry::Head& head_a = (*heads_a)[pairs[n].first];
    const geometry::Head& head_b = (*heads_b)[pairs[n].second];
    HeadDifference d;
    d.name = head_a.name();
    d.other = head_b.name();
    d.raw_deg = angle_of(Rb[n] * Ra[n].transpose());
    d.turned_deg = angle_of(Rb[n] * R_b_a * Ra[n].transpose());
    turned.add(d.turned_deg);
    const std::vector<geometry::RayPixel> samples = geometry::sample_head(head_a);
    if (head_a.width() == head_b.width() && head_a.height() == head_b.height()) {
      const Spread lens = distances(samples, head_b, Eigen::Matrix3d::Identity());
      d.lens_rms_px = lens.rms();
      d.lens_max_px = lens.most;
      const Spread all = distances(samples, head_b, Rb[n] * R_b_a * Ra[n].transpose());
      d.rms_px = all.rms();
      d.max_px = all.most;
    } else {
      difference.notes.push_back("Head '" + d.name + "' has pictures of two sizes: its pixels are not compared.");
    }
    compare_light(head_a, head_b, samples, d);
    difference.heads.push_back(std::move(d));
  }
  take_out_mean_gain(difference.heads);
  difference.turned_rms_deg = turned.rms();
  return difference;
}

}  // namespace nodal::calibration
