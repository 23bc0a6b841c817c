// What `nodal stitch` makes of its arguments before it blends: pictures, a calibration, and the size of the result.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tool/console/console.h"
#include "host_tool/input/rig_pictures.h"
#include "host_tool/input/up_choice.h"
#include "host_tool/output/sphere_crop.h"
#include "host_tool/report/html_report.h"
#include "protocol/base/result.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/media/raymap/raymap_file.h"
#include "stitch/table/table_compiler.h"

namespace nodal::host {

struct StitchArgs {
  std::vector<std::string> inputs;
  NominalWords nominal;
  std::string out = "sphere.jpg";
  std::string layout = "equirectangular";
  int width = 0;
  int bits = 8;
  std::string blend = "best";  ///< or "board"
  std::string quality;         ///< quality of JPEGs; empty: the blend's
  std::string transition = "two-band";
  double seam_width_deg = table::TableOptions().seam_width_deg;
  double feather = table::TableOptions().feather;
  int threads = 0;
  double distance = 0;  ///< 0: the calibration's
  std::string up = "auto", split = "auto", crop = "auto";
  PicturePlaces places = PicturePlaces::kBesideProject;
};

inline bool best(const StitchArgs& args) { return args.blend == "best"; }

/// The parameters that all raymaps of a run share.
struct StitchJob {
  StitchArgs args;
  media::RaymapFormat format = media::RaymapFormat::kJpg;
  geometry::RaymapSize size;       ///< size of the whole raymap
  double share = 1;                ///< share of the sphere that the heads see
  std::optional<RaymapPart> part;  ///< the part of the raymap that is written, if not all
  bool part_is_all_seen = false;   ///< beyond it no head sees anything
  RigPictures rig;
  std::optional<HtmlReport> details;  ///< how a calibration from the pictures was registered
};

/// The name of a file that belongs to the raymaps `out`: sphere.jpg or sphere-%04d.jpg, ".rig.json" -> sphere.rig.json.
std::string beside(const std::string& out, const std::string& ending);

/// The bar of the whole command: of a calibration from pictures until kCalibrated, then of the raymaps until kStitched.
inline constexpr std::uint64_t kCalibrated = 6'000, kStitched = 10'000;

/// Reads or finds the calibration, and plans the raymaps. A calibration that is found is written beside the
/// result.
Result<StitchJob> make_stitch_job(Console& console, const StitchArgs& args, Progress& bar);

}  // namespace nodal::host
