// Blends raymaps from pictures in memory as the board does.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/offline/parts.h"
#include "stitch/table/table_compiler.h"

namespace nodal::sets {
struct BlendPlan;
}

namespace nodal::offline {

/// The resolution of the heads in pixels per radian: the largest that any head has at the centre of its region.
/// Errors: those of geometry::make_heads.
Result<double> resolution_of(const Calibration& calibration);

/// Compiles a table once, and blends any number of frame sets with it. More than kMaxHeads heads are blended in parts
/// (parts.h), each with a table of its own; the bytes are those of one table of all heads.
///
/// Threading: thread-bound; starts its own threads and waits for them.
/// Ownership: does not refer to the calibration after make().
/// Errors: those of table::TableCompiler and of cut_into_parts().
class OfflineBlend {
 public:
  /// `head_format`: the format of every head's pictures. `threads` 0: one per core. `progress` is called on the calling
  /// thread with the fraction that is compiled, 0 .. 1; exceptions that it throws are passed on. Parts have at most
  /// `heads_per_part` heads; what a blend has does not depend on it.
  static Result<OfflineBlend> make(const Calibration& calibration, const table::RaymapSpec& raymap,
                                   const table::TableOptions& options, PixelFormat head_format, int threads,
                                   const std::function<void(double)>& progress = {},
                                   std::size_t heads_per_part = kMaxHeads);

  /// Blends one frame set: one picture per head, in the calibration's order; a picture without data is a missing head.
  /// Errors: kHeadMismatch, with the head's number, for a picture of another size or format than the head's.
  Result<DecodedImage> blend(std::span<const ImageView> pictures) const;

 private:
  struct PlanOfPart {
    std::shared_ptr<const sets::BlendPlan> plan;
    Part part;
  };
  OfflineBlend(std::size_t heads, int threads) : heads_(heads), threads_(threads) {}

  std::size_t heads_;
  int threads_;
  std::vector<PlanOfPart> parts_;
};

}  // namespace nodal::offline
