// Pairs of fisheyes back to back, rendered by the simulator, which shares no projection code with the stitcher, and how
// far calibrations from their pictures alone, and from a data sheet, are from the truth.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "protocol/calibration.h"
#include "tests/support/rendered_rig.h"

namespace nodal::bench {

struct FisheyePair {
  std::string family;  ///< equidistant, equisolid, stereographic, or polynomial: between the first two
  std::string scene;   ///< town (far away), near (a room with columns close by), room, tiles (which repeat)
  double view_deg = 200;
  bool tilted = false;  ///< the heads are tilted by 20 degrees, one up and one down
  int side = 720;       ///< side of the pictures, px
};

/// The campaign's pairs: 0 to 39.
FisheyePair pair_of(int number);

/// The pair with small errors of mounting, as `seed` draws them.
Calibration true_pair(const FisheyePair& pair, int seed);
test::RenderedRig rendered_pair(const FisheyePair& pair, const Calibration& truth, int seed);

/// Errors of a calibration of a pair. Lens: of the distance from the axis, percent, the larger one of both heads.
struct PairErrors {
  std::array<double, 4> lens{};  ///< at 10, 45 and 80 degrees, and at 98 % of the field of view
  double worst = 0;              ///< anywhere up to 99 % of it
  double worst_known = 0;        ///< where the result says that the lens is known; 0 if it says so nowhere
  double rotation_deg = 0;
  double up_deg = 0;
};

struct PairVerdict {
  std::string refused;  ///< the error; empty: it was placed
  PairErrors errors;
  std::size_t points = 0;
  double known_from_px = 0, known_to_px = 0;  ///< where the result says that the lens is known
  bool whole = false;                         ///< everywhere
  std::string family;                         ///< what it assumes elsewhere
  double unsure_percent = 0;                  ///< how wrong the lens may be there, as the note says it
  std::vector<std::string> notes;
};

/// `nodal stitch` of the pictures alone.
PairVerdict judged_alone(const FisheyePair& pair, const Calibration& truth, const std::vector<std::string>& files);
/// `nodal register --nominal 2xDEGREES` with the true field of view.
struct NominalAsked {
  bool family = false;  ///< `--lens FAMILY`, the pair's; the polynomial is not one, and counts as equidistant
  bool lenses = false;  ///< `--free lens`
};
PairVerdict judged_nominal(const FisheyePair& pair, const Calibration& truth, const std::vector<std::string>& files,
                           const NominalAsked& asked);

/// Writes the pictures as PNGs into a folder, which is emptied; returns their names.
/// Errors: kIo.
Result<std::vector<std::string>> written(const test::RenderedRig& rig, const std::filesystem::path& folder);

}  // namespace nodal::bench
