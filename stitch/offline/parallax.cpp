#include "stitch/offline/parallax.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

namespace nodal::offline {
namespace {

constexpr double kHighestDeg = 75;  ///< highest latitude of a chart
constexpr double kFadeDeg = 10;     ///< width of the fade at its upper and lower edge
constexpr int kProbes = 128;        ///< rays along a whole circle that are tried first
constexpr int kMinOverlap = 24;     ///< px; smaller ones are left alone
constexpr int kTurned = 32;         ///< px that a whole circle is continued by at its ends

double smooth_step(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace

OverlapChart::OverlapChart(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int columns)
    : columns_(columns),
      rows_(static_cast<int>(2 * kHighestDeg / 360 * columns)),
      pitch_(2 * std::numbers::pi / columns) {
  const Eigen::Vector3d across = (b - a).norm() > 0.1 ? (b - a).normalized() : a.unitOrthogonal();
  Eigen::Vector3d middle = a + b;
  middle -= middle.dot(across) * across;
  middle = middle.norm() > 0.1 ? middle.normalized() : across.unitOrthogonal();
  axes_.row(0) = middle;
  axes_.row(1) = across.cross(middle);
  axes_.row(2) = across;
}

Eigen::Vector3d OverlapChart::ray(double u, double v) const {
  const double along = (u - columns_ / 2.0) * pitch_, up = (v - rows_ / 2.0) * pitch_;
  return axes_.transpose() *
         Eigen::Vector3d(std::cos(up) * std::cos(along), std::cos(up) * std::sin(along), std::sin(up));
}

void OverlapChart::place(const Eigen::Vector3d& ray, double& u, double& v) const {
  const Eigen::Vector3d at = axes_ * ray;
  u = std::atan2(at.y(), at.x()) / pitch_ + columns_ / 2.0;
  v = std::atan2(at.z(), std::hypot(at.x(), at.y())) / pitch_ + rows_ / 2.0;
}

OverlapChart::Part OverlapChart::part(int left, int top, int width, int height) const {
  constexpr double kMargin = 1e-6;
  const auto sine_at = [&](int v) {
    const double up = (v - rows_ / 2.0) * pitch_;
    return std::sin(std::clamp(up, -std::numbers::pi / 2, std::numbers::pi / 2));
  };
  const double along = (left + width / 2.0 - columns_ / 2.0) * pitch_, half = width / 2.0 * pitch_;
  return {sine_at(top) - kMargin, sine_at(top + height) + kMargin, Eigen::Vector2d(std::cos(along), std::sin(along)),
          half < std::numbers::pi ? std::cos(half) - kMargin : -2};
}

bool OverlapChart::may_be_in(const Part& part, const Eigen::Vector3d& ray) const {
  const Eigen::Vector3d at = axes_ * ray;
  if (at.z() < part.least_up || at.z() > part.most_up) return false;
  return at.head<2>().dot(part.middle) >= part.least_along * at.head<2>().norm();
}

Parallax::Parallax(const std::vector<HeadView>& heads, std::span<const ImageView> pictures, int columns,
                   const parallel::Workers& workers)
    : heads_(heads), of_head_(heads.size()) {
  std::vector<std::unique_ptr<HeadPicture>> made(heads.size());
  std::vector<const HeadPicture*> known;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    if (pictures[h].planes[0].data != nullptr) made[h] = std::make_unique<HeadPicture>(heads[h], pictures[h]);
    known.push_back(made[h].get());
  }
  for (std::size_t a = 0; a < heads.size(); ++a) {
    for (std::size_t b = a + 1; b < heads.size(); ++b) {
      if (!known[a] || !known[b]) continue;
      const Eigen::Vector3d from = heads[a].head().axis().direction();
      const Eigen::Vector3d to = heads[b].head().axis().direction();
      overlaps_.push_back({a, b, OverlapChart(from, to, columns), 0, 0, {}, {}});
    }
  }
  workers.run(static_cast<int>(overlaps_.size()), [&](int i) { find(overlaps_[static_cast<std::size_t>(i)], known); });
  std::erase_if(overlaps_, [](const Overlap& overlap) { return overlap.flow.x.empty(); });
  for (std::size_t k = 0; k < overlaps_.size(); ++k) {
    of_head_[overlaps_[k].a].push_back(k);
    of_head_[overlaps_[k].b].push_back(k);
  }
}

void Parallax::find(Overlap& overlap, std::span<const HeadPicture* const> pictures) const {
  const OverlapChart& chart = overlap.chart;
  const int probe = std::max(1, chart.columns() / kProbes);
  const HeadView &a = heads_[overlap.a], &b = heads_[overlap.b];
  int left = chart.columns(), right = -1, top = chart.rows(), bottom = -1;
  for (int y = 0; y < chart.rows(); y += probe) {
    for (int x = 0; x < chart.columns(); x += probe) {
      const Eigen::Vector3d ray = chart.ray(x + 0.5, y + 0.5);
      if (!a.see(ray) || !b.see(ray)) continue;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  if (right - left < kMinOverlap || bottom - top < kMinOverlap) return;
  const bool closed = left < probe && right >= chart.columns() - probe;
  left = closed ? -kTurned : std::max(0, left - probe);
  right = closed ? chart.columns() + kTurned : std::min(chart.columns(), right + probe);
  top = std::max(0, top - probe);
  bottom = std::min(chart.rows(), bottom + probe);
  const int width = right - left, height = bottom - top;
  const std::size_t size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  SeenPicture of_a{width, height, std::vector<float>(size), std::vector<float>(size)}, of_b = of_a;
  std::vector<float> share(size, 0.5F);
  const auto fill = [&](const HeadPicture& picture, const std::optional<Sighting>& seen, std::size_t k,
                        SeenPicture& to) {
    if (!seen) return;
    std::array<float, 4> colours{};
    picture.sample(*seen, chart.radians_per_pixel(), colours.data());
    float sum = 0;
    for (int c = 0; c < picture.colours(); ++c) sum += colours[static_cast<std::size_t>(c)];
    to.levels[k] = sum / static_cast<float>(picture.colours());
    to.seen[k] = 1;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t k = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const Eigen::Vector3d ray = chart.ray(left + x + 0.5, top + y + 0.5);
      const auto by_a = a.see(ray), by_b = b.see(ray);
      fill(*pictures[overlap.a], by_a, k, of_a);
      fill(*pictures[overlap.b], by_b, k, of_b);
      const double score_a = by_a ? by_a->score : 0, score_b = by_b ? by_b->score : 0;
      if (score_a + score_b > 0) share[k] = static_cast<float>(score_a / (score_a + score_b));
    }
  }
  overlap.left = left;
  overlap.top = top;
  overlap.flow = flow_between(of_a, of_b, share);
  overlap.part = chart.part(left, top, width, height);
}

Eigen::Vector3d Parallax::moved(std::size_t head, const Eigen::Vector3d& ray) const {
  const auto own = heads_[head].see(ray);
  if (!own) return ray;
  struct Move {
    double score;
    Eigen::Vector3d by;
  };
  double sum = own->score;
  Eigen::Vector3d by = Eigen::Vector3d::Zero();
  for (const std::size_t k : of_head_[head]) {
    const Overlap& overlap = overlaps_[k];
    if (!overlap.chart.may_be_in(overlap.part, ray)) continue;
    const std::size_t other = overlap.a == head ? overlap.b : overlap.a;
    double u, v;
    overlap.chart.place(ray, u, v);
    if (v < overlap.top || v > overlap.top + overlap.flow.height || u < overlap.left ||
        u > overlap.left + overlap.flow.width)
      continue;
    const auto seen = heads_[other].see(ray);
    if (!seen) continue;
    double dx, dy;
    overlap.flow.at(u - overlap.left, v - overlap.top, dx, dy);
    const double from_edge = std::min(v, overlap.chart.rows() - v) * overlap.chart.radians_per_pixel();
    const double fade = smooth_step(from_edge / (kFadeDeg / 180 * std::numbers::pi));
    const double sign = overlap.a == head ? -1 : 1;
    sum += seen->score;
    // The share of the other head is divided out below; moves are along the chart, so that large ones stay on the
    // sphere.
    const double share = seen->score / (own->score + seen->score) * fade * sign;
    by += (overlap.chart.ray(u + share * dx, v + share * dy) - ray) * (own->score + seen->score);
  }
  return (ray + by / sum).normalized();
}

}  // namespace nodal::offline
