// Blends pictures of the sphere band by band (Burt and Adelson, "A Multiresolution Spline With Application to Image
// Mosaics", 1983): each band of detail passes from one picture to the next one over a width of about its wavelength, so
// that neither a step in brightness nor a double outline shows.
#pragma once

#include <vector>

#include "stitch/bands/layer.h"
#include "stitch/parallel/workers.h"

namespace nodal::bands {

/// The sphere that is blended; pictures are added one by one.
///
/// Threading: thread-bound; starts its own threads and waits for them.
/// Memory: 4 (colours + 1) x 4/3 bytes a pixel of the window; add() takes 4 (colours + 2) x 4/3 bytes a pixel of the
///   layer's window for its duration. Both twice as much while the finest level is reduced, for a moment.
class MultiBand {
 public:
  /// Only `window` is blended; outside of it no picture shows anything.
  MultiBand(Grid grid, const Window& window, int colours, int threads);

  /// Adds a picture, whose window lies in the blend's. Its channels are the colours, then 1 where the picture shows
  /// anything and 0 elsewhere, then 1 where the result shows this picture and 0 elsewhere. Colours are 0 where nothing
  /// is shown. Beyond its edges a picture is continued by its coarser bands, so that an edge close to a seam does no
  /// harm.
  void add(Layer picture);

  /// The window: the blended colours, then a channel that is 0 where no picture was to show. Call once.
  Layer finish();

 private:
  int colours_;
  parallel::Workers workers_;
  std::vector<Grid> grids_;
  std::vector<Layer> sums_;  ///< sums of each level: weighted colours, weight
};

}  // namespace nodal::bands
