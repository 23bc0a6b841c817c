#include "stitch/registration/ray_set.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>

#include "protocol/base/try.h"

namespace nodal::registration {
namespace {

using geometry::Ray;
using geometry::RaymapLayout;

struct Place {
  int i, j;
};

constexpr int kTileWidth = 16, kTileHeight = kTile / kTileWidth;

void set_cone(Tile& tile, const std::vector<Eigen::Vector3d>& rays) {
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& ray : rays) axis += ray;
  const double length = axis.norm();
  double cosine = -1;  // if the rays cancel each other: the whole sphere
  if (length > 1e-9) {
    axis /= length;
    cosine = 1;
    for (const Eigen::Vector3d& ray : rays) cosine = std::min(cosine, axis.dot(ray));
  }
  // Slightly larger, so that rounding to float never excludes a ray.
  cosine = std::max(-1.0, cosine - 1e-6);
  for (int k = 0; k < 3; ++k) tile.axis[k] = static_cast<float>(axis[k]);
  tile.cos_radius = static_cast<float>(cosine);
  tile.sin_radius = static_cast<float>(std::sqrt(1 - cosine * cosine));
}

// False if no ray at these places is wanted.
bool fill(Tile& tile, const RaymapLayout& layout, const std::vector<Place>& places,
          const std::function<bool(const Tile&)>& wanted) {
  std::vector<Eigen::Vector3d> rays;
  std::vector<Place> held;
  for (const Place& place : places) {
    if (const std::optional<Ray> ray = layout.ray(place.i + 0.5, place.j + 0.5)) {
      rays.push_back(ray->direction());
      held.push_back(place);
    }
  }
  if (rays.empty()) return false;
  set_cone(tile, rays);
  if (!wanted(tile)) return false;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kTile); ++k) {
    const std::size_t from = std::min(k, rays.size() - 1);
    tile.x[k] = static_cast<float>(rays[from].x());
    tile.y[k] = static_cast<float>(rays[from].y());
    tile.z[k] = static_cast<float>(rays[from].z());
    tile.omega[k] = k < rays.size() ? static_cast<float>(layout.solid_angle(held[k].i, held[k].j)) : 0.0F;
  }
  return true;
}

// For layouts whose neighbouring pixels have no neighbouring rays: their pixels, sorted so that rays are neighbours.
std::vector<Place> sorted_places(const RaymapLayout& layout) {
  struct Keyed {
    std::uint64_t key;
    Place place;
  };
  std::vector<Keyed> all;
  for (int j = 0; j < layout.height(); ++j) {
    for (int i = 0; i < layout.width(); ++i) {
      const std::optional<Ray> ray = layout.ray(i + 0.5, j + 0.5);
      if (!ray) continue;
      // In the order of a Z-curve over the cube around the sphere.
      std::uint64_t key = 0;
      for (int bit = 9; bit >= 0; --bit) {
        for (int k = 0; k < 3; ++k) {
          const auto q = static_cast<std::uint64_t>((ray->direction()[k] + 1) * 511.5);
          key = key << 1 | (q >> bit & 1);
        }
      }
      all.push_back({key, {i, j}});
    }
  }
  std::ranges::stable_sort(all, {}, &Keyed::key);
  std::vector<Place> places;
  places.reserve(all.size());
  for (const Keyed& each : all) places.push_back(each.place);
  return places;
}

}  // namespace

Result<std::unique_ptr<RaymapLayout>> layout_of_width(const std::string& name, int width) {
  if (name.starts_with("rays:")) {
    return fail(Errc::kUnsupported,
                "registration begins with coarse raymaps, and a list of rays has one size; give another "
                "layout");
  }
  NODAL_TRY_ASSIGN(const geometry::LayoutName layout, geometry::LayoutName::parse(name));
  const geometry::RaymapSize size = layout.size_for_width(layout.width_for_resolution(width / (2 * std::numbers::pi)));
  return geometry::make_layout(layout, size.width, size.height);
}

std::vector<Tile> make_tiles(const RaymapLayout& layout, const parallel::Workers& workers,
                             const std::function<bool(const Tile&)>& wanted) {
  std::vector<Place> sorted;
  if (layout.scattered()) sorted = sorted_places(layout);
  const int across = (layout.width() + kTileWidth - 1) / kTileWidth;
  const int bands = layout.scattered() ? 64 : (layout.height() + kTileHeight - 1) / kTileHeight;
  std::vector<std::vector<Tile>> made(static_cast<std::size_t>(bands));
  workers.run(bands, [&](int band) {
    std::vector<Tile>& tiles = made[static_cast<std::size_t>(band)];
    std::vector<Place> places;
    const auto keep = [&] {
      Tile tile;
      if (fill(tile, layout, places, wanted)) tiles.push_back(tile);
      places.clear();
    };
    if (layout.scattered()) {
      const std::size_t n = sorted.size(), b = static_cast<std::size_t>(band);
      for (std::size_t k = n * b / 64; k < n * (b + 1) / 64; ++k) {
        places.push_back(sorted[k]);
        if (places.size() == kTile) keep();
      }
      if (!places.empty()) keep();
      return;
    }
    for (int column = 0; column < across; ++column) {
      for (int j = band * kTileHeight; j < std::min((band + 1) * kTileHeight, layout.height()); ++j) {
        for (int i = column * kTileWidth; i < std::min((column + 1) * kTileWidth, layout.width()); ++i) {
          places.push_back({i, j});
        }
      }
      keep();
    }
  });
  std::vector<Tile> tiles;
  for (const std::vector<Tile>& band : made) tiles.insert(tiles.end(), band.begin(), band.end());
  return tiles;
}

}  // namespace nodal::registration
