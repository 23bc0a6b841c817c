// What all raymaps share whose neighbouring pixels hold no neighbouring rays: the search for the nearest ray.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// A layout of points. Its index of rays is built at the first search, because a board never searches.
///
/// Threading: as RaymapLayout; threads that search first at one time each build an index, and one of them stays.
class ScatteredRays : public RaymapLayout {
 public:
  ~ScatteredRays() override { delete index_.load(); }
  bool scattered() const final { return true; }
  std::optional<Ray> ray(double x, double y) const final;
  std::optional<Pixel> pixel(const Ray& ray) const final;
  /// Calls found(i, j, its ray) once for every pixel whose ray is within `reach` rad of `ray`, and for some beyond.
  void visit(const Ray& ray, double reach, const std::function<void(int, int, const Ray&)>& found) const;

 protected:
  using RaymapLayout::RaymapLayout;
  /// The ray of pixel (i, j) of the picture.
  virtual Ray ray_of(int i, int j) const = 0;

 private:
  /// Pixels by cell: strips along circles of latitude, about as high as neighbouring rays are apart, cut by longitude.
  struct Index {
    std::vector<std::uint32_t> cells_before;  ///< number of cells above each strip, and of all
    std::vector<std::uint32_t> begin;         ///< index in `pixels` of each cell's first pixel, and the end
    std::vector<std::uint32_t> pixels;        ///< row * width + column

    int strips() const { return static_cast<int>(cells_before.size()) - 1; }
    int strip_of(double phi) const;
    std::uint32_t cell_of(int strip, double theta) const;
  };
  std::unique_ptr<const Index> build() const;
  const Index& index() const;

  mutable std::atomic<const Index*> index_{nullptr};
};

}  // namespace nodal::geometry
