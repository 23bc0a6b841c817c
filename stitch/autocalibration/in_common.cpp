#include "stitch/autocalibration/in_common.h"

#include <algorithm>
#include <cmath>

namespace nodal::autocalibration {
namespace {

// Share of a picture's features that the other one should show, too: a large overlap.
constexpr double kMuchShared = 0.6;
constexpr double kMinMatched = 0.06;  // share of these features that must have matches
constexpr double kAgreeing = 0.02;    // two features match if they agree within this, units of radius
constexpr std::size_t kAsked = 400;   // features of a picture that are projected

/// Where the picture `to` shows what `from` shows at a pixel.
std::optional<geometry::Pixel> shown_at(const LensRays& rays, const Shape& from, geometry::Pixel pixel, const Shape& to,
                                        const Eigen::Matrix3d& R_to_from) {
  const geometry::Pixel center = from.center(), other = to.center();
  const auto ray = rays.ray(Eigen::Vector2d(pixel.x - center.x, pixel.y - center.y) / from.unit());
  const auto at = ray ? rays.at(R_to_from * *ray) : std::nullopt;
  if (!at || (to.circle && at->norm() > 1)) return std::nullopt;
  const geometry::Pixel found{other.x + at->x() * to.unit(), other.y + at->y() * to.unit()};
  const bool inside = found.x > 0 && found.y > 0 && found.x < to.width && found.y < to.height;
  return inside ? std::optional(found) : std::nullopt;
}

}  // namespace

InCommon::InCommon(const std::vector<Shape>& shapes, const std::vector<std::vector<Feature>>& features,
                   const std::vector<Match>& matches)
    : shapes_(shapes), features_(features), of_pair_(shapes.size() * shapes.size()) {
  for (const Match& match : matches) of_pair_[match.a * shapes.size() + match.b].push_back(match);
}

double InCommon::agreeing(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens) const {
  const Result<LensRays> rays = LensRays::make(lens);
  if (!rays) return 0;
  const std::vector<Feature>& seen = features_[a];
  const std::size_t step = 1 + seen.size() / kAsked;
  double asked = 0, shared = 0;
  for (std::size_t n = 0; n < seen.size(); n += step) {
    ++asked;
    shared += shown_at(*rays, shapes_[a], seen[n].pixel, shapes_[b], R_b_a) ? 1 : 0;
  }
  const double tolerance = kAgreeing * shapes_[b].unit();
  const auto agree =
      static_cast<double>(std::ranges::count_if(of_pair_[a * shapes_.size() + b], [&](const Match& match) {
        const auto other = shown_at(*rays, shapes_[a], match.pixel_a, shapes_[b], R_b_a);
        return other && std::hypot(other->x - match.pixel_b.x, other->y - match.pixel_b.y) < tolerance;
      }));
  const bool much = asked > 0 && shared > kMuchShared * asked;
  const double expected = kMinMatched * shared * static_cast<double>(step);
  return much && agree < expected ? 0 : agree;
}

}  // namespace nodal::autocalibration
