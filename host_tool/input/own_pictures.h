// A rig from nothing but its pictures: autocalibration, then registration as far as the pictures allow.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/registration.h"

namespace nodal::autocalibration {
struct Match;
}

namespace nodal::host {

/// Whether it is a folder, or a file that starts like a picture, also one of a format that is not read, or is called like
/// one.
bool is_picture(const std::string& path);

/// Pictures of a rig without a calibration.
struct OwnPictureSets {
  std::vector<std::vector<std::string>> sets;  ///< for each set one file per head
  std::vector<std::string> names;              ///< of the heads
  std::vector<std::string> notes;              ///< whole sentences: what in the folders is no picture
};

/// The pictures among the arguments. Two or more folders are a folder for each head, with a sequence: the n-th pictures,
/// sorted by name, are a set, and heads are called after the folders. Otherwise all pictures are one set (a folder stands
/// for the pictures in it, sorted by name; copies are left out with a note), and heads are called after the files. Where
/// names cannot be heads' names, they are cam0, cam1 and so on.
/// Errors: kBadValue for an argument that is neither, for two that are the same picture, or for folders with different
///   numbers of pictures, with what to do; kNotFound for a folder without pictures.
Result<OwnPictureSets> own_pictures(const std::vector<std::string>& arguments);

/// Called on the caller's thread with the share of the work that is done, and what is being done.
using OwnProgress = std::function<void(double done, const std::string& what)>;

/// A range of distances from the lens's axis in the first placed picture.
struct LensRange {
  double from_px = 0, to_px = 0;
  double from_deg = 0, to_deg = 0;  ///< of the rays, with the lens that was found
};

/// Where points determine the lens.
struct FoundLens {
  std::string family;  ///< what is assumed of the lens elsewhere: "equidistant"; empty: nothing
  LensRange seen;      ///< where there are points
  LensRange known;     ///< where they determine the lens to 2 %; empty: nowhere
  double unsure = 0;   ///< how wrong it may be elsewhere, part of the distance from the axis
  bool mostly = true;  ///< known over most of the radius
  bool whole = true;   ///< known everywhere
  std::string note;    ///< what of it is assumed, in whole sentences; empty: nothing

  double may_be_wrong_percent() const;  ///< `unsure`, rounded up
};

struct FirstCalibration {
  Calibration calibration;           ///< of the pictures that were placed, in their order
  std::vector<std::size_t> heads;    ///< their indices in the set
  std::vector<std::string> placed;   ///< their files
  std::vector<DecodedImage> images;  ///< of these files
  std::string confidence;            ///< one sentence: how many were placed, by what, and how well they agree
  std::vector<std::string> notes;    ///< whole sentences: pictures left out, what could not be determined
  std::shared_ptr<const std::vector<autocalibration::Match>>
      points;  ///< the matches that agree, between placed pictures
  FoundLens lens;
};

/// The lens and the rotations of a set's heads by matched points; files[n] is of head names[n].
/// Errors: those of reading pictures and of autocalibrate(), with what to do.
Result<FirstCalibration> first_calibration(const std::vector<std::string>& files, const std::vector<std::string>& names,
                                           const OwnProgress& progress);

/// Registers the pictures as far as they determine it: the whole lens, else the focal lengths, else rotations, else gains
/// and fall-off only; of a lens that points do not determine over most of its radius, rotations at most. A result counts only if it places
/// every head, lets the pictures differ less than without it, and agrees with the points as well as the first calibration:
/// near things, which heads see in different directions, draw pictures away from them.
Result<registration::Report> refined(const FirstCalibration& first, const OwnProgress& progress);

}  // namespace nodal::host
