// Raymaps at full quality, for computers with time: seams placed where the pictures agree, blended in many bands.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/bands/layer.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/offline/head_picture.h"
#include "stitch/offline/seam_check.h"
#include "stitch/seams/placement.h"
#include "stitch/table/table_compiler.h"

namespace nodal::offline {

class SightGrid;

/// Blends sets of pictures, one after the other. Each head's picture is projected onto an equirectangular sphere in
/// floating point, with cubic interpolation; what heads see from different places is moved together (parallax.h). Seams
/// are placed on a map of at most kMapWidth columns (of a part of the sphere up to four times as many; stitch/seams),
/// and the pictures are blended there by stitch/bands.
/// Other layouts are sampled from that sphere. Sets are taken as a film: seams stay where they were unless another
/// place is clearly better.
///
/// Threading: thread-bound; starts its own threads and waits for them.
/// Memory: about 60 bytes a pixel of the sphere, or of its part that heads see, up to 15 MB a head for where it is
/// sampled, and the pictures, 1.3 times; before that, up to 25 MB a thread for flows.
/// Ownership: does not refer to the calibration after make().
class BestBlend {
 public:
  static constexpr int kMapWidth = 1024;
  static constexpr std::int64_t kMaxPixels = std::int64_t{1} << 26;

  /// Any number of heads that a calibration may have. `threads` 0: one per core; the result does not depend on it.
  /// `seen`: the part of an equirectangular raymap beyond which no head sees anything; raymaps are this part, then, and
  /// memory, time and kMaxPixels go by its pixels.
  /// Errors: those of geometry::make_heads and geometry::make_layout; kUnsupported for other formats than RGB24, GREY,
  ///   RGB48 and GREY16; kTooLarge for spheres of more than kMaxPixels.
  static Result<BestBlend> make(const Calibration& calibration, const table::RaymapSpec& raymap, int threads,
                                std::optional<bands::Window> seen = {});

  /// One picture per head, in the calibration's order; RGB24, or GREY for a grey raymap; one without data is a missing
  /// head. `checks`, if not null, gets how well the pictures go on across the seams of this set. `progress`: 0..1, on
  /// the caller's thread.
  /// Errors: kHeadMismatch, with the head's number, for a picture of another size or format.
  Result<DecodedImage> blend(std::span<const ImageView> pictures, std::vector<SeamCheck>* checks = nullptr,
                             const std::function<void(double)>& progress = {});

  /// The seams of the last set, and their map.
  const seams::Labels& labels() const { return labels_; }
  bands::Grid map() const { return map_; }

 private:
  BestBlend() = default;
  Status check_pictures(std::span<const ImageView> pictures) const;
  /// The head that shows each pixel of seen_.
  std::vector<std::uint8_t> owners(std::span<const SightGrid> sights) const;
  void choose_owners_of_row(int y, std::span<const SightGrid> sights, std::uint8_t* owners) const;
  DecodedImage in_layout(const bands::Layer& sphere) const;

  PixelFormat format_ = PixelFormat::kRgb24;
  std::unique_ptr<geometry::RaymapLayout> layout_;
  bool equirectangular_ = true;
  bands::Grid sphere_, map_;
  int finer_ = 1;       ///< how much finer than for a whole sphere the seams' map and the flow are
  bands::Window seen_;  ///< the part of sphere_ that is blended
  double power_ = 1;
  double full_ = 255;  ///< number at which 65535 of linear light is blended; 255 if light is not linear
  std::vector<HeadView> heads_;
  std::vector<bands::Window> windows_;  ///< windows of the heads, on sphere_
  int threads_ = 0;
  seams::Labels labels_;
};

}  // namespace nodal::offline
