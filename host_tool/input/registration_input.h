// The input of a registration: pictures from files, and a rig's geometry from its data sheet.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/media/image_file.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// Pictures in memory, one per head and set.
struct PictureSets {
  std::vector<std::vector<DecodedImage>> sets;
  std::vector<registration::FrameSet> frames() const;
};

/// The files of the pictures, one per head and set. The arguments are either pictures, in the calibration's order, set
/// after set; or folders with one picture per head, named after the head (cam0.png); or one folder per head, named after
/// it, with a sequence of pictures. `names`: the heads' names.
/// Errors: kBadValue with what is missing or superfluous; kNotFound for a folder without a head's picture.
Result<std::vector<std::vector<std::string>>> picture_files(const std::vector<std::string>& arguments,
                                                            const std::vector<std::string>& names);
/// Reads the pictures from the files of picture_files(). `of_linear_heads`: as for read_all().
/// Errors: those of picture_files() and of reading pictures.
Result<PictureSets> read_pictures(const std::vector<std::string>& arguments, const std::vector<std::string>& names,
                                  const std::vector<bool>& of_linear_heads = {});

struct CalibratedPictures {
  Calibration calibration;
  PictureSets pictures;
};
/// Reads a calibration file, then pictures like read_pictures().
/// Errors: those of parse_calibration() and read_pictures(); kMissingField if there are no pictures.
Result<CalibratedPictures> read_calibrated_pictures(const std::vector<std::string>& arguments);

/// A rig's data sheet as words of the command line.
struct NominalWords {
  std::string rig;                   ///< "3x190"; empty: there is none
  std::vector<std::string> circles;  ///< "1920,1080,1587"
  std::vector<std::string> places;   ///< "90,-30" or "90,-30,180"
  std::string lens = "fisheye";      ///< or "rectilinear"
  double roll_deg = 0;
};

/// Where a head looks, degrees: to the right, up, and its roll, clockwise.
struct NominalPlace {
  double yaw = 0, pitch = 0, roll = 0;
};

/// A rig described by its data sheet: `--nominal 3x190`.
struct Nominal {
  int heads = 0;
  double view_deg = 0;       ///< across a fisheye's circle, or from the left to the right edge of the picture
  bool rectilinear = false;  ///< else equidistant fisheyes
  double roll_deg = 0;       ///< of every head, clockwise
  std::vector<Region::Circle> circles;  ///< one per head, one for all, or none: then they are found in the pictures
  std::vector<NominalPlace> places;     ///< one per head, or none: evenly around the horizon
};
/// "3x190": heads and degrees. Errors: kBadValue.
Result<Nominal> parse_nominal(const std::string& text);
/// "1920,1080,1587": x, y, radius. Errors: kBadValue.
Result<Region::Circle> parse_circle(const std::string& text);
/// "90,-30" or "90,-30,180": yaw, pitch, roll. Errors: kBadValue.
Result<NominalPlace> parse_place(const std::string& text);
/// Heads at their places; without places evenly spaced around the horizon, the first one forward, the next to its right. One
/// picture per head. Without circles, a fisheye's circle is found by its picture's black border; else it is the largest
/// centred one.
/// Errors: kBadValue if the number of circles, places or pictures does not match the heads, or a lens cannot have the field
///   of view or a circle; those of check_calibration.
Result<Calibration> nominal_rig(const Nominal& nominal, const std::vector<DecodedImage>& pictures);

/// The nominal rig and its pictures, with read_pictures()'s arguments; folders hold cam0.png, cam1.png and so on.
/// Errors: those of the functions above, with the option; kMissingField without pictures.
Result<CalibratedPictures> read_nominal_pictures(const NominalWords& words, const std::vector<std::string>& arguments);

}  // namespace nodal::host
