#include "stitch/calibration/light/light_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace nodal::calibration {
namespace {

constexpr int kRays = 60'000;
constexpr int kPlaces = 4'000;                 // per head
constexpr int kPatch = 2;                      // px to each side: five by five
constexpr int kDarkest = 5, kBrightest = 250;  // a pixel outside is crushed or clipped
constexpr double kMaxDetail = 16;              // levels; a patch with more shows an edge, not a brightness
constexpr double kNoise = 1;                   // standard deviation of a patch's mean, levels
constexpr double kMisplaced = 0.4;             // difference due to misaligned heads, as a share of a patch's detail

struct Patch {
  std::array<double, 3> mean{};  // levels
  double detail = 0;             // standard deviation in levels, of the channel with the most detail
};

/// The patch around a point; nothing if it leaves the picture, is clipped or crushed, or has too much detail.
std::optional<Patch> patch_at(const ImageView& image, geometry::Pixel at) {
  const int x = static_cast<int>(std::floor(at.x)), y = static_cast<int>(std::floor(at.y));
  if (x < kPatch || y < kPatch || x >= image.width - kPatch || y >= image.height - kPatch) return std::nullopt;
  constexpr double kCount = (2 * kPatch + 1) * (2 * kPatch + 1);
  Patch patch;
  for (std::size_t c = 0; c < 3; ++c) {
    const PlaneView& plane = image.planes[c];
    double sum = 0, square = 0;
    for (int j = y - kPatch; j <= y + kPatch; ++j) {
      for (int i = x - kPatch; i <= x + kPatch; ++i) {
        const int v = plane.data[j * plane.row_stride + i * plane.pixel_stride];
        if (v < kDarkest || v > kBrightest) return std::nullopt;
        sum += v;
        square += v * v;
      }
    }
    patch.mean[c] = sum / kCount;
    patch.detail = std::max(patch.detail, std::sqrt(std::max(0.0, square / kCount - patch.mean[c] * patch.mean[c])));
  }
  if (patch.detail > kMaxDetail) return std::nullopt;
  return patch;
}

/// One observation, before it is known whether another head or set saw the same light.
struct Sighting {
  int head;
  double s, stops;
  Patch patch;
};

void add_group(const std::vector<Sighting>& sightings, double misplaced, LightGroups& groups) {
  if (sightings.size() < 2) return;
  for (int c = 0; c < 3; ++c) {
    for (const Sighting& seen : sightings) {
      const double mean = seen.patch.mean[static_cast<std::size_t>(c)];
      const double spread = misplaced * seen.patch.detail;
      groups.all.push_back(
          {seen.head, c, mean / 255, seen.s, seen.stops, mean * mean / (kNoise * kNoise + spread * spread)});
    }
    groups.first.push_back(groups.all.size());
  }
}

double squared_radius(const HeadCalibration& head, geometry::Pixel p) {
  const double r = std::hypot(p.x - head.center_x, (p.y - head.center_y) / head.aspect) / fall_off_radius(head);
  return r * r;
}

}  // namespace

double fall_off_radius(const HeadCalibration& head) { return std::hypot(head.width, head.height / head.aspect) / 2; }

LightGroups shared_rays(const std::vector<geometry::Head>& heads, const std::vector<ExposedSet>& sets) {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  LightGroups groups;
  std::vector<std::pair<int, geometry::Pixel>> seen;
  std::vector<Sighting> sightings;
  for (int n = 0; n < kRays; ++n) {
    const double z = 1 - 2 * (n + 0.5) / kRays, across = std::sqrt(1 - z * z), turn = golden * n;
    const auto ray = geometry::Ray::towards(across * std::cos(turn), across * std::sin(turn), z);
    seen.clear();
    for (std::size_t h = 0; h < heads.size(); ++h) {
      const auto pixel = heads[h].project(ray);
      if (pixel && heads[h].distance_to_edge(*pixel) > kPatch + 1) seen.emplace_back(static_cast<int>(h), *pixel);
    }
    if (seen.size() < 2) continue;
    for (const ExposedSet& set : sets) {
      sightings.clear();
      for (const auto& [h, pixel] : seen) {
        const auto head = static_cast<std::size_t>(h);
        const std::optional<Patch> patch = patch_at(set.frames[head], pixel);
        // All heads of a set share its exposure, so its stops do not affect their differences: 0.
        if (patch) sightings.push_back({h, squared_radius(heads[head].calibration(), pixel), 0, *patch});
      }
      add_group(sightings, kMisplaced, groups);
    }
  }
  return groups;
}

LightGroups same_places(const std::vector<geometry::Head>& heads, const std::vector<ExposedSet>& sets) {
  LightGroups groups;
  std::vector<Sighting> sightings;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const int width = heads[h].width(), height = heads[h].height();
    const double step = std::sqrt(static_cast<double>(width) * height / kPlaces);
    for (double y = step / 2; y < height; y += step) {
      for (double x = step / 2; x < width; x += step) {
        const geometry::Pixel pixel{x, y};
        if (heads[h].distance_to_edge(pixel) <= kPatch + 1) continue;
        sightings.clear();
        for (const ExposedSet& set : sets) {
          if (!set.stops) continue;
          const std::optional<Patch> patch = patch_at(set.frames[h], pixel);
          if (patch) {
            sightings.push_back(
                {static_cast<int>(h), squared_radius(heads[h].calibration(), pixel), *set.stops, *patch});
          }
        }
        add_group(sightings, 0, groups);
      }
    }
  }
  return groups;
}

}  // namespace nodal::calibration
