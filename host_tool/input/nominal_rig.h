// A rig's geometry from its data sheet.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// A rig's data sheet as words of the command line.
struct NominalWords {
  std::string rig;                   ///< "3x190"; empty: there is none
  std::vector<std::string> circles;  ///< "1920,1080,1587"
  std::vector<std::string> places;   ///< "90,-30" or "90,-30,180"
  std::string lens = "fisheye";      ///< the same as "equidistant"; or the name of another family
  double roll_deg = 0;
};

/// Where a head looks, degrees: to the right, up, and its roll, clockwise.
struct NominalPlace {
  double yaw = 0, pitch = 0, roll = 0;
};

/// A rig described by its data sheet: `--nominal 3x190`.
struct Nominal {
  int heads = 0;
  double view_deg = 0;  ///< across a fisheye's circle, or from the left to the right edge of a rectilinear picture
  std::string lens = "equidistant";     ///< a name of autocalibration::Family
  double roll_deg = 0;                  ///< roll of every head, clockwise
  std::vector<Region::Circle> circles;  ///< one per head, one for all, or none: then they are found in the pictures
  std::vector<NominalPlace> places;     ///< one per head, or none: evenly around the horizon
};
/// "3x190": heads and degrees. Errors: kBadValue.
Result<Nominal> parse_nominal(const std::string& text);
/// "1920,1080,1587": x, y, radius. Errors: kBadValue.
Result<Region::Circle> parse_circle(const std::string& text);
/// "90,-30" or "90,-30,180": yaw, pitch, roll. Errors: kBadValue.
Result<NominalPlace> parse_place(const std::string& text);
/// "fisheye", or the name of a family, which is returned. Errors: kBadValue.
Result<std::string> parse_nominal_lens(const std::string& text);
/// The data sheet that words describe. Errors: those of the functions above, with the option.
Result<Nominal> nominal_of(const NominalWords& words);
/// Heads at their places; without places evenly spaced around the horizon, the first one forward, the next to its
/// right. One picture per head. Without circles, a fisheye's circle is found by its picture's black border; else it is
/// the largest centred one.
/// Errors: kBadValue if the number of circles, places or pictures does not match the heads, or a lens cannot have the
///   field of view or a circle; those of check_calibration.
Result<Calibration> nominal_rig(const Nominal& nominal, std::span<const ImageView> pictures);

}  // namespace nodal::host
