// Placed seams: what the heads show on a small map of the sphere, and the tables whose seams lie where that agrees.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/blend/tone.h"
#include "stitch/seams/placement.h"
#include "stitch/sets/blend_plan.h"
#include "stitch/table/seamed_table.h"

namespace nodal::sets {

/// The heads' pictures of one set on the map, for placing seams.
struct SeamPictures {
  std::uint32_t heads = 0;                       ///< bit i: head i was in the set
  std::vector<std::vector<std::uint8_t>> views;  ///< by head, packed
};

/// Made with a calibration's tables. A view is blended like a raymap, with a table of that head alone, so that gain,
/// exposure and vignetting are undone; luma, or R G B, is compared.
///
/// Threading: immutable; any thread.
/// Errors: those of table::TableCompiler.
class SeamViews {
 public:
  /// `tables`: those of the calibration for this raymap, each with a cover.
  static Result<std::shared_ptr<const SeamViews>> make(const Calibration& calibration, const RaymapConfig& raymap,
                                                       std::span<const blend::BlendTable> tables);

  /// Pictures with memory for all views.
  SeamPictures empty_pictures() const;
  /// Bytes of scratch memory that view() needs for a head.
  std::size_t scratch_size(std::size_t head) const;
  /// Makes a head's view of its picture (a field, where tables are for fields). Allocates nothing.
  void view(std::size_t head, const ImageView& picture, const blend::ToneTable& exposures,
            std::span<const blend::ExposedHead> exposed, std::uint8_t* scratch, SeamPictures& into) const;

  /// The seams of least cost; they stay where `previous` has them unless others are clearly better. Empty: none before.
  seams::Labels place(const SeamPictures& pictures, const seams::Labels& previous) const;
  /// `tables` with these seams, proven. They are those of make() (`before` is empty), or made by this with the labels
  /// `before`.
  Result<std::vector<blend::BlendTable>> tables(std::span<const blend::BlendTable> tables, const seams::Labels& before,
                                                const seams::Labels& labels) const;

 private:
  SeamViews() = default;

  std::vector<blend::BlendTable> views_;    ///< by head; each has all sources, and tiles of its head only
  std::vector<std::vector<float>> scores_;  ///< by head, on the map
  std::vector<table::SeamedTable> seamed_;  ///< one for each table
};

}  // namespace nodal::sets
