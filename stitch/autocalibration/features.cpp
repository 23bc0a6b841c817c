#include "stitch/autocalibration/features.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "stitch/geometry/masks.h"

extern "C" {
#include <vl/sift.h>
}

namespace nodal::autocalibration {
namespace {

constexpr int kLevels = 3;        // per octave, as in Lowe's paper
constexpr double kPeak = 1.5;     // smallest contrast of the difference of Gaussians, levels of 255
constexpr double kEdge = 10;      // largest ratio of the principal curvatures
constexpr double kDescribed = 6;  // the descriptor reaches this many scales from its point
constexpr double kBlob = 2;       // scales between a feature at the rim and the edge, so that its blob is inside
constexpr double kDarkRim = 2;    // px within which the light falls off at the circle
constexpr int kCells = 8;         // the picture is divided into this many cells each way
constexpr double kDescriptorScale = 512;
constexpr double kSmallBlob = 1.5, kLargeBlob = 5;  // px, scales; those between are used first

struct Delete {
  void operator()(VlSiftFilt* filter) const { vl_sift_delete(filter); }
};

/// Where features are sought.
struct Where {
  Region region;
  geometry::Masks masks;
  double margin = kDescribed;  ///< distance of a feature from the region's edge, in its scales
  double from_radius = 0;      ///< smallest distance from the circle's centre, px
};

bool inside(const Where& where, double x, double y, double scale) {
  const Region& region = where.region;
  const double margin = where.margin * scale;
  if (x - margin < region.left || y - margin < region.top) return false;
  if (x + margin > region.right || y + margin > region.bottom) return false;
  if (!where.masks.empty() && where.masks.distance({x, y}, margin) < margin) return false;
  if (!region.circle) return true;
  const double radius = std::hypot(x - region.circle->x, y - region.circle->y);
  return radius >= where.from_radius && radius + margin <= region.circle->radius;
}

std::array<std::uint8_t, kDescriptorSize> in_bytes(const std::array<float, kDescriptorSize>& values) {
  std::array<std::uint8_t, kDescriptorSize> bytes{};
  for (std::size_t i = 0; i < kDescriptorSize; ++i) {
    bytes[i] = static_cast<std::uint8_t>(std::lround(std::clamp(kDescriptorScale * double{values[i]}, 0.0, 255.0)));
  }
  return bytes;
}

void add_octave(VlSiftFilt& filter, const Where& where, std::vector<Feature>& found) {
  vl_sift_detect(&filter);
  const VlSiftKeypoint* keys = vl_sift_get_keypoints(&filter);
  for (int k = 0; k < vl_sift_get_nkeypoints(&filter); ++k) {
    // VLFeat's coordinates are those of samples: the first one is at 0.
    const double x = double{keys[k].x} + 0.5, y = double{keys[k].y} + 0.5, scale = double{keys[k].sigma};
    if (!inside(where, x, y, scale)) continue;
    std::array<double, 4> turns{};
    const int count = vl_sift_calc_keypoint_orientations(&filter, turns.data(), &keys[k]);
    for (int t = 0; t < count; ++t) {
      std::array<float, kDescriptorSize> values{};
      vl_sift_calc_keypoint_descriptor(&filter, values.data(), &keys[k], turns[static_cast<std::size_t>(t)]);
      found.push_back({{x, y}, scale, in_bytes(values)});
    }
  }
}

/// Mirrors the picture at the circle, so that the circle is no edge for descriptors.
void mirror_beyond(const Region::Circle& circle, Picture& picture) {
  const Picture whole = picture;
  const double edge = circle.radius - kDarkRim;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const double dx = x + 0.5 - circle.x, dy = y + 0.5 - circle.y, radius = std::hypot(dx, dy);
      if (radius <= edge) continue;
      const double by = std::max(0.0, 2 * edge - radius) / radius;
      const int i = std::clamp(static_cast<int>(circle.x + by * dx), 0, picture.width - 1);
      const int j = std::clamp(static_cast<int>(circle.y + by * dy), 0, picture.height - 1);
      picture
          .values[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x)] =
          whole.at(i, j);
    }
  }
}

/// Whether a blob of scale `a` is used before one of scale `b`: first the middle ones, then the large ones, then the
/// small ones.
bool before(double a, double b) {
  const auto kind = [](double scale) { return scale < kSmallBlob ? 2 : scale > kLargeBlob ? 1 : 0; };
  if (kind(a) != kind(b)) return kind(a) < kind(b);
  return kind(a) == 1 ? a < b : a > b;
}

std::vector<Feature> features_in(const Picture& picture, const Where& where, std::size_t most) {
  std::vector<Feature> found;
  const std::unique_ptr<VlSiftFilt, Delete> filter(vl_sift_new(picture.width, picture.height, -1, kLevels, 0));
  if (!filter) return {};
  vl_sift_set_peak_thresh(filter.get(), kPeak);
  vl_sift_set_edge_thresh(filter.get(), kEdge);
  for (int state = vl_sift_process_first_octave(filter.get(), picture.values.data()); state == VL_ERR_OK;
       state = vl_sift_process_next_octave(filter.get())) {
    add_octave(*filter, where, found);
  }
  std::ranges::stable_sort(found, [](const Feature& a, const Feature& b) { return before(a.scale, b.scale); });
  // Takes the first feature of every cell, then the second of every cell, and so on.
  std::array<std::vector<const Feature*>, std::size_t{kCells} * kCells> cells;
  for (const Feature& one : found) {
    const int i = std::clamp(static_cast<int>(kCells * one.pixel.x / picture.width), 0, kCells - 1);
    const int j = std::clamp(static_cast<int>(kCells * one.pixel.y / picture.height), 0, kCells - 1);
    cells[static_cast<std::size_t>(j * kCells + i)].push_back(&one);
  }
  std::vector<Feature> features;
  for (std::size_t rank = 0; features.size() < most; ++rank) {
    bool any = false;
    for (const auto& cell : cells) {
      if (rank >= cell.size() || features.size() == most) continue;
      features.push_back(*cell[rank]);
      any = true;
    }
    if (!any) break;
  }
  return features;
}

}  // namespace

std::vector<Feature> find_features(const Picture& picture, const Region& region, std::size_t most) {
  return features_in(picture, {region, geometry::Masks(region)}, most);
}

std::vector<Feature> find_rim_features(Picture picture, const Region& region, std::size_t most, double from_radius) {
  mirror_beyond(*region.circle, picture);
  return features_in(picture, {region, geometry::Masks(region), kBlob, from_radius}, most);
}

}  // namespace nodal::autocalibration
