// Raymaps from pictures in memory, by the tables and kernels that the board runs.
#pragma once

#include <functional>
#include <span>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/blend_table.h"
#include "stitch/table/table_compiler.h"

namespace nodal::offline {

/// Pixels per radian of the heads: the most that any head has at the middle of its region.
/// Errors: the calibration's own.
Result<double> resolution_of(const Calibration& calibration);

/// A table that is compiled once, and blends any number of sets.
///
/// Threading: thread-bound; starts threads of its own and waits for them.
/// Ownership: keeps nothing of the calibration.
/// Errors: those of table::TableCompiler.
class OfflineBlend {
 public:
  /// `head_format`: of every head's pictures. `threads` 0: one a core. `progress` is called on the calling thread with the
  /// part that is compiled, 0 .. 1; what it throws passes through.
  static Result<OfflineBlend> make(const Calibration& calibration, const table::RaymapSpec& raymap,
                                   const table::TableOptions& options, PixelFormat head_format, int threads,
                                   const std::function<void(double)>& progress = {});

  /// The raymap of one set: one picture a head, in the calibration's order; a picture without data is a missing head.
  /// Errors: kHeadMismatch, with the head's number, for a picture of another size or format than the head's.
  Result<DecodedImage> blend(std::span<const ImageView> pictures) const;

 private:
  OfflineBlend(blend::BlendTable table, int threads) : table_(std::move(table)), threads_(threads) {}

  blend::BlendTable table_;
  int threads_;
};

}  // namespace nodal::offline
