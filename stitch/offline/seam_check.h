// How well pictures go on across the seams of a raymap: what a person looks for in it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/bands/layer.h"
#include "stitch/geometry/ray.h"
#include "stitch/offline/head_picture.h"
#include "stitch/parallel/workers.h"
#include "stitch/seams/placement.h"

namespace nodal::offline {

/// A place of a seam at which both pictures have detail.
struct SeamPlace {
  geometry::Angles at;
  /// By how much lines jump there, pixels of the raymap: the least shift at which the pictures look alike.
  double jump_px = 0;
  bool alike =
      true;  ///< false: they do not look alike at any shift that was tried; `jump_px` is then the largest tried
  /// How far apart the rays are along which the two pictures are sampled here: lines were bent so that they go on.
  double bent_px = 0;
};

/// All that is known of one seam, between heads `a` < `b`.
struct SeamCheck {
  std::size_t a = 0, b = 0;
  std::size_t looked_at = 0;      ///< places, evenly along the seam
  std::vector<SeamPlace> places;  ///< those of them where both pictures have detail
  double step_levels = 0;         ///< how much brighter `b` is than `a` on average, levels of 255
};

/// What a person would say of a seam, or of a whole raymap: its worst seam's.
enum class SeamVerdict : std::uint8_t {
  kGood,    ///< at its full size nobody finds the seam
  kUsable,  ///< lines jump by some pixels, or are bent by more, which is seen by who looks for it
  kLook,    ///< something is cut or doubled
};

/// Lines that jump by up to kFinePx are not seen: a sharp edge is as wide as that. Those that jump by more than
/// kBrokenPx are seen at once: a thin line jumps by more than its own width.
inline constexpr double kFinePx = 2, kBrokenPx = 6;
/// Largest bend of lines, made so that they go on, that nobody sees; a larger one shows on lines known to be straight.
inline constexpr double kFineBendPx = 4;
/// A seam of which at most this share of the places with detail is worse than that is still called good or usable: a
/// leaf that moved is no broken picture.
inline constexpr double kMaxWorseShare = 0.1;
/// Steps in brightness. The blend spreads them over the overlap, where the smaller one is not seen.
inline constexpr double kFineStep = 12, kBrokenStep = 30;

SeamVerdict verdict_of(const SeamCheck& seam);
SeamVerdict verdict_of(std::span<const SeamCheck> seams);
/// The jump that all but kMaxWorseShare of the places stay below, px; likewise how far lines were bent.
double usual_jump(const SeamCheck& seam);
double usual_bend(const SeamCheck& seam);
/// The place that should be looked at first; nothing if no place has detail.
const SeamPlace* worst_place(const SeamCheck& seam);

/// The ray along which a head's picture is sampled for a ray of the raymap; empty: the same ray.
using MovedRay = std::function<Eigen::Vector3d(std::size_t head, const Eigen::Vector3d& ray)>;

/// The head that shows each pixel of a map.
struct SeamMap {
  const seams::Labels& labels;
  bands::Grid grid;
};

/// The seams of a raymap with `raymap` pixels, if it were equirectangular. pictures: RGB24 or GREY, one a head; one
/// without data is a missing head's. Seams come in the order of their heads.
std::vector<SeamCheck> check_seams(const std::vector<HeadView>& heads, std::span<const ImageView> pictures,
                                   const MovedRay& moved, const SeamMap& map, bands::Grid raymap,
                                   const parallel::Workers& workers);

/// The same for the seams that a rig's board has: each ray is shown by the head that shows it best. pictures: one a
/// head in its order, RGB24, GREY, or a format whose first plane is its luminance; without data, a missing head.
/// Errors: those of geometry::make_heads.
Result<std::vector<SeamCheck>> check_seams(const Calibration& calibration, std::span<const ImageView> pictures,
                                           bands::Grid raymap, int threads);

}  // namespace nodal::offline
