#include "stitch/geometry/raymap/scattered_rays.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
std::optional<Ray> ScatteredRays::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  return ray_of(std::min(static_cast<int>(x), width() - 1), std::min(static_cast<int>(y), height() - 1));
}

int ScatteredRays::Index::strip_of(double phi) const {
  return std::clamp(static_cast<int>((phi / kPi + 0.5) * strips()), 0, strips() - 1);
}

std::uint32_t ScatteredRays::Index::cell_of(int strip, double theta) const {
  const std::uint32_t first = cells_before[static_cast<std::size_t>(strip)];
  const auto cells = static_cast<double>(cells_before[static_cast<std::size_t>(strip) + 1] - first);
  return first + static_cast<std::uint32_t>(std::clamp((theta / (2 * kPi) + 0.5) * cells, 0.0, cells - 1));
}

std::unique_ptr<const ScatteredRays::Index> ScatteredRays::build() const {
  auto made = std::make_unique<Index>();
  const double apart = std::sqrt(4 * kPi / width() / height());
  const int strips = std::max(1, static_cast<int>(kPi / apart));
  made->cells_before.push_back(0);
  for (int s = 0; s < strips; ++s) {
    const double around = 2 * kPi * std::cos(kPi * ((s + 0.5) / strips - 0.5));
    made->cells_before.push_back(made->cells_before.back() + static_cast<std::uint32_t>(std::max(1.0, around / apart)));
  }
  std::vector<std::uint32_t> cells;
  cells.reserve(static_cast<std::size_t>(width()) * static_cast<std::size_t>(height()));
  made->begin.assign(made->cells_before.back() + 1, 0);
  for (int j = 0; j < height(); ++j) {
    for (int i = 0; i < width(); ++i) {
      const Angles at = ray_of(i, j).angles();
      cells.push_back(made->cell_of(made->strip_of(at.phi), at.theta));
      ++made->begin[cells.back() + 1];
    }
  }
  for (std::size_t c = 1; c < made->begin.size(); ++c) made->begin[c] += made->begin[c - 1];
  std::vector<std::uint32_t> next(made->begin.begin(), made->begin.end() - 1);
  made->pixels.resize(cells.size());
  for (std::size_t k = 0; k < cells.size(); ++k) made->pixels[next[cells[k]]++] = static_cast<std::uint32_t>(k);
  return made;
}

const ScatteredRays::Index& ScatteredRays::index() const {
  if (const Index* built = index_.load()) return *built;
  std::unique_ptr<const Index> mine = build();
  const Index* other = nullptr;
  return index_.compare_exchange_strong(other, mine.get()) ? *mine.release() : *other;
}

void ScatteredRays::visit(const Ray& ray, double reach, const std::function<void(int, int, const Ray&)>& found) const {
  const Index& index = this->index();
  const Angles at = ray.angles();
  // Within `reach`, longitude differs by up to asin(sin reach / cos phi).
  const double sine = std::sin(std::min(reach, kPi / 2)) / std::max(1e-300, std::cos(at.phi));
  const double side = sine < 1 ? std::asin(sine) : kPi;
  for (int s = index.strip_of(at.phi - reach); s <= index.strip_of(at.phi + reach); ++s) {
    const std::uint32_t first = index.cells_before[static_cast<std::size_t>(s)];
    const std::uint32_t count = index.cells_before[static_cast<std::size_t>(s) + 1] - first;
    const double cells = side / (2 * kPi) * count;
    const std::uint32_t about = 2 * static_cast<std::uint32_t>(cells) + 3;
    const std::uint32_t searched = std::min(count, about);
    const std::uint32_t middle = index.cell_of(s, at.theta) - first;
    for (std::uint32_t k = 0; k < searched; ++k) {
      const std::uint32_t cell = first + (middle + 2 * count - about / 2 % count + k) % count;
      for (std::uint32_t p = index.begin[cell]; p < index.begin[cell + 1]; ++p) {
        const auto w = static_cast<std::uint32_t>(width());
        const auto i = static_cast<int>(index.pixels[p] % w), j = static_cast<int>(index.pixels[p] / w);
        found(i, j, ray_of(i, j));
      }
    }
  }
}

std::optional<Pixel> ScatteredRays::pixel(const Ray& ray) const {
  Pixel best;
  double nearest = 10;  // squared length of the chord
  // All rays within `reach` are searched, and farther ones until one is found that is within it.
  for (double reach = 1.5 * kPi / index().strips();; reach *= 2) {
    visit(ray, reach, [&](int i, int j, const Ray& other) {
      const double away = (other.direction() - ray.direction()).squaredNorm();
      if (away < nearest) nearest = away, best = Pixel{i + 0.5, j + 0.5};
    });
    if (2 * std::asin(std::min(1.0, std::sqrt(nearest) / 2)) <= reach || reach > kPi) break;
  }
  return best;
}

}  // namespace nodal::geometry
