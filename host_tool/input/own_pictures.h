// A rig from nothing but its pictures: autocalibration, then registration as far as the pictures allow.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// Whether it is a folder, or a file that starts like a picture or is called like one.
bool is_picture(const std::string& path);

/// Pictures of a rig without a calibration.
struct OwnPictureSets {
  std::vector<std::vector<std::string>> sets;  ///< for each set one file per head
  std::vector<std::string> names;              ///< of the heads
};

/// The pictures among the arguments. Two or more folders are a folder for each head, with a sequence: the n-th pictures,
/// sorted by name, are a set, and heads are called after the folders. Otherwise all pictures are one set (a folder stands
/// for the pictures in it, sorted by name), and heads are called after the files. Where names cannot be heads' names, they
/// are cam0, cam1 and so on.
/// Errors: kBadValue for an argument that is neither, or folders with different numbers of pictures, with what to do;
///   kNotFound for a folder without pictures.
Result<OwnPictureSets> own_pictures(const std::vector<std::string>& arguments);

/// Called on the caller's thread with the share of the work that is done, and what is being done.
using OwnProgress = std::function<void(double done, const std::string& what)>;

struct FirstCalibration {
  Calibration calibration;           ///< of the pictures that were placed, in their order
  std::vector<std::size_t> heads;    ///< their indices in the set
  std::vector<std::string> placed;   ///< their files
  std::vector<DecodedImage> images;  ///< of these files
  std::string confidence;            ///< one sentence: how many were placed, by what, and how well they agree
  std::vector<std::string> notes;    ///< whole sentences: pictures left out, what could not be determined
};

/// The lens and the rotations of a set's heads by matched points; files[n] is of head names[n].
/// Errors: those of reading pictures and of autocalibrate(), with what to do.
Result<FirstCalibration> first_calibration(const std::vector<std::string>& files, const std::vector<std::string>& names,
                                           const OwnProgress& progress);

/// Registers the pictures as far as they determine it: the whole lens, else the focal lengths, else gains and fall-off
/// only. A result counts only if it places every head and lets the pictures differ less than without it.
Result<registration::Report> refined(const FirstCalibration& first, const OwnProgress& progress);

}  // namespace nodal::host
