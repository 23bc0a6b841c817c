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

/// Whether the file starts like a picture or is called like one, or the folder holds files that start so.
bool is_picture(const std::string& path);

/// The pictures among the arguments; a folder stands for the pictures in it, sorted by name.
/// Errors: kBadValue for an argument that is neither, with what to do; kNotFound for a folder without pictures.
Result<std::vector<std::string>> own_picture_files(const std::vector<std::string>& arguments);

/// Called on the caller's thread with the share of the work that is done, and what is being done.
using OwnProgress = std::function<void(double done, const std::string& what)>;

struct FirstCalibration {
  Calibration calibration;           ///< of the pictures that were placed, in their order
  std::vector<std::string> placed;   ///< their files
  std::vector<DecodedImage> images;  ///< of these files
  std::string confidence;            ///< one sentence: how many were placed, by what, and how well they agree
  std::vector<std::string> notes;    ///< whole sentences: pictures left out, what could not be determined
};

/// The lens and the rotations by matched points. Heads are called after their files where the names allow it.
/// Errors: those of reading pictures and of autocalibrate(), with what to do.
Result<FirstCalibration> first_calibration(const std::vector<std::string>& files, const OwnProgress& progress);

/// Registers the pictures as far as they determine it: the whole lens, else the focal lengths, else gains and fall-off
/// only. A result counts only if it places every head and lets the pictures differ less than without it.
Result<registration::Report> refined(const FirstCalibration& first, const OwnProgress& progress);

}  // namespace nodal::host
