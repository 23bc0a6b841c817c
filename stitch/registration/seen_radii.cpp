#include "stitch/registration/seen_radii.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"

namespace nodal::registration {
namespace {

constexpr double kMinSpan = 0.4;
constexpr int kSamples = 96;        // samples of a picture along each axis
constexpr std::size_t kRings = 50;  // rings that the radius is divided into
constexpr double kSeen = 0.03;      // share of a ring's samples that other heads must show, too

struct Ring {
  double samples = 0, shared = 0;
  bool seen() const { return shared > kSeen * samples; }
};

using Rings = std::array<Ring, kRings>;

/// The largest distance of a used point from the lens's centre, px.
double edge_of(const geometry::Head& head) {
  double edge = 0;
  for (int y = 0; y < kSamples; ++y) {
    for (int x = 0; x < kSamples; ++x) {
      const geometry::Pixel at{(x + 0.5) / kSamples * head.width(), (y + 0.5) / kSamples * head.height()};
      const HeadCalibration& is = head.calibration();
      if (head.contains(at)) edge = std::max(edge, std::hypot(at.x - is.center_x, (at.y - is.center_y) / is.aspect));
    }
  }
  return edge;
}

/// The angle from the lens's axis, rad, of a share of the radius at the edge.
double angle_at(const geometry::Head& head, double edge, double share) {
  return head.lens().angle(std::min(share * edge, head.lens().max_radius())).value_or(0);
}

/// The share of the angle from a head's axis to its edge that the seen rings cover; 1 for a lens that does not reach
/// beyond 90 degrees, of which heads that look away from each other show nothing in common. Rings near the edge of a
/// stereographic lens are narrow in angle: 70 to 110 degrees are half of its radius.
double seen_angles(const geometry::Head& head, const Rings& rings) {
  const double edge = edge_of(head), whole = angle_at(head, edge, 1);
  double sum = 0;
  for (std::size_t r = 0; r < kRings; ++r) {
    const double from = static_cast<double>(r) / kRings, to = static_cast<double>(r + 1) / kRings;
    if (rings[r].seen()) sum += angle_at(head, edge, to) - angle_at(head, edge, from);
  }
  return whole > std::numbers::pi / 2 ? sum / whole : 1;
}

}  // namespace

bool SeenRadii::determine_lenses() const { return span >= kMinSpan; }

Result<SeenRadii> seen_radii(const Calibration& calibration) {
  NODAL_TRY_ASSIGN(const std::vector<geometry::Head> heads, geometry::make_heads(calibration));
  Rings rings;
  SeenRadii seen{0, 180, 0};
  for (const geometry::Head& head : heads) {
    const HeadCalibration& is = head.calibration();
    const double edge = edge_of(head);
    Rings own;
    for (int n = 0; n < kSamples * kSamples; ++n) {
      const geometry::Pixel at{(n % kSamples + 0.5) / kSamples * head.width(),
                               (n / kSamples + 0.5) / kSamples * head.height()};
      const auto ray = head.contains(at) ? head.unproject(at) : std::nullopt;
      if (!ray) continue;
      const double radius = std::hypot(at.x - is.center_x, (at.y - is.center_y) / is.aspect);
      Ring& ring = own[std::min(kRings - 1, static_cast<std::size_t>(radius / edge * kRings))];
      ++ring.samples;
      ring.shared += std::ranges::any_of(
          heads, [&](const geometry::Head& other) { return &other != &head && other.pixel_of(*ray); });
    }
    for (std::size_t r = 0; r < kRings; ++r) {
      rings[r].samples += own[r].samples;
      rings[r].shared += own[r].shared;
      if (!own[r].seen()) continue;
      const double from = angle_at(head, edge, static_cast<double>(r) / kRings);
      const double to = angle_at(head, edge, static_cast<double>(r + 1) / kRings);
      seen.from_deg = std::min(seen.from_deg, from * kDegreesPerRadian);
      seen.to_deg = std::max(seen.to_deg, to * kDegreesPerRadian);
    }
  }
  seen.span = static_cast<double>(std::ranges::count_if(rings, &Ring::seen)) / kRings;
  for (const geometry::Head& head : heads) seen.span = std::min(seen.span, seen_angles(head, rings));
  return seen;
}

}  // namespace nodal::registration
