// The two steps of a Laplacian pyramid (Burt and Adelson 1983) on the whole sphere, and sampling between its pixels.
#pragma once

#include <vector>

#include "stitch/bands/layer.h"
#include "stitch/parallel/workers.h"

namespace nodal::bands {

/// Halves the grid (rounded up) as often as its width stays at kMinWidth or more; the first one is `finest`.
std::vector<Grid> grids_below(Grid finest);
inline constexpr int kMinWidth = 32;  ///< smallest width of the coarsest grid; its pixels span about 11 degrees

/// The window of the coarser grid that holds everything that a layer with the window `from` becomes by reduced().
Window reduced_window(Grid fine, const Window& from, Grid coarse);

/// A coarser picture: the mean with a triangular filter, (1 3 3 1) / 8 at the equator. In other rows it is
/// wider by 1 / cos(latitude), so that it has the same extent on the sphere everywhere, and rows go on
/// beyond a pole on the opposite meridian; the picture is closed, without a seam at 180 degrees or a star at the poles.
/// Outside the layer's window its numbers count as 0. The result's window holds everything that is not 0.
Layer reduced(const Layer& fine, Grid coarse, const parallel::Workers& workers);

/// The coarse picture at the pixels of finer rows, by quadratic B-splines: continuous, with continuous slopes.
///
/// Ownership: keeps the layer by reference.
class Expansion {
 public:
  Expansion(const Layer& coarse, Grid fine) : coarse_(coarse), fine_(fine) {}
  /// `row` of the fine grid, columns x .. x + width - 1 (continued at the end of the row), into width x channels
  /// numbers. Beyond the coarse layer's window, its outermost pixels are used.
  void row(int y, int x, int width, std::vector<float>& into) const;

 private:
  const Layer& coarse_;
  Grid fine_;
};

/// The layer, which holds the whole grid, at (u, v) in its pixels (the first one's centre is at 1/2, 1/2), by Catmull
/// and Rom's cubic; into `channels` numbers.
void sample_cubic(const Layer& whole, double u, double v, float* into);

}  // namespace nodal::bands
