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

/// The files of pictures, one a head and set. Each argument is a picture, in the calibration's order, set after set; or a folder
/// with one picture a head, called as the head is (cam0.png). `names`: the heads'.
/// Errors: kBadValue with what is missing or too much; kNotFound for a folder without a head's picture.
Result<std::vector<std::vector<std::string>>> picture_files(const std::vector<std::string>& arguments,
                                                            const std::vector<std::string>& names);
/// The pictures in the files that picture_files() names.
/// Errors: those of picture_files() and of reading pictures.
Result<PictureSets> read_pictures(const std::vector<std::string>& arguments, const std::vector<std::string>& names);

struct CalibratedPictures {
  Calibration calibration;
  PictureSets pictures;
};
/// Reads a calibration file, then pictures like read_pictures(). Errors: those of parse_calibration() and
/// read_pictures(); kMissingField if there are no pictures.
Result<CalibratedPictures> read_calibrated_pictures(const std::vector<std::string>& arguments);

/// A rig as its data sheet has it, as words of the command line.
struct NominalWords {
  std::string rig;                   ///< "3x190"; empty: there is none
  std::vector<std::string> circles;  ///< "1920,1080,1587"
  double roll_deg = 0;
};

/// A rig as its data sheet has it: `--nominal 3x190`.
struct Nominal {
  int heads = 0;
  double view_deg = 0;                  ///< across the circle
  double roll_deg = 0;                  ///< of every head, clockwise
  std::vector<Region::Circle> circles;  ///< one a head, one for all, or none: they are found in the pictures
};
/// "3x190": heads and degrees. Errors: kBadValue.
Result<Nominal> parse_nominal(const std::string& text);
/// "1920,1080,1587": x, y, radius. Errors: kBadValue.
Result<Region::Circle> parse_circle(const std::string& text);
/// Equidistant fisheyes evenly round the horizon, the first one forward, the next to its right, for one picture a head.
/// Without circles, a head's is that in which its picture is not black, or the largest one in the middle of its picture.
/// Errors: kBadValue for a number of circles or pictures that is not that of the heads; those of check_calibration.
Result<Calibration> nominal_rig(const Nominal& nominal, const std::vector<DecodedImage>& pictures);

/// The nominal rig and its pictures, as read_pictures() takes them; folders hold cam0.png, cam1.png and so on.
/// Errors: those of the functions above, with the option; kMissingField without pictures.
Result<CalibratedPictures> read_nominal_pictures(const NominalWords& words, const std::vector<std::string>& arguments);

}  // namespace nodal::host
