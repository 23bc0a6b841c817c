// The input of `nodal stitch`: a calibration in any format that Nodal reads, and the files of pictures.
#pragma once

#include <string>
#include <vector>

#include "host_tool/input/project_pictures.h"
#include "host_tool/input/registration_input.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

struct StitchInput {
  Calibration calibration;
  std::vector<std::vector<std::string>> sets;  ///< for each set one file per head, in the calibration's order
  std::vector<std::string> notes;              ///< whole sentences for the user
  bool imported = false;                       ///< the calibration is of a data sheet or another program's project
};

/// `arguments`: with `nominal`, pictures of that rig; else a Nodal calibration or a project of another program, then
/// pictures as for picture_files(). A project that names its pictures needs no further ones: their paths are relative
/// to the project's folder, and `places` says where they may be.
/// Errors: those of parse_calibration(), of interchange::import_project(), of project_pictures() and of
///   picture_files(), with the file; kMissingField without pictures.
Result<StitchInput> read_stitch_input(const NominalWords& nominal, const std::vector<std::string>& arguments,
                                      PicturePlaces places = PicturePlaces::kBesideProject);

/// One picture per head, all in one pixel format: I420 if every file is 4:2:0, GREY if every one is grey, else RGB24.
/// With `rgb`: always RGB24.
/// Errors: those of reading pictures; kHeadMismatch, with the file and the head, for a picture whose size differs from
///   its head's.
Result<std::vector<DecodedImage>> read_set(const std::vector<std::string>& files, const Calibration& calibration,
                                           bool rgb);

}  // namespace nodal::host
