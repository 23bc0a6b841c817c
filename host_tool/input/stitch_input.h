// The input of `nodal stitch`: a calibration in any format that Nodal reads, and the files of pictures.
#pragma once

#include <string>
#include <vector>

#include "host_tool/input/registration_input.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

struct StitchInput {
  Calibration calibration;
  std::vector<std::vector<std::string>> sets;  ///< of each set one file a head, in the calibration's order
  std::vector<std::string> notes;              ///< whole sentences for the user
};

/// `arguments`: with `nominal` pictures of that rig; else a calibration of Nodal's or a project of another program, then
/// pictures as picture_files() takes them.
/// A project that names its pictures needs none: their paths count from the project's folder.
/// Errors: those of parse_calibration(), of interchange::import_project() and of picture_files(), with the file;
///   kMissingField without pictures.
Result<StitchInput> read_stitch_input(const NominalWords& nominal, const std::vector<std::string>& arguments);

/// One picture a head, all in one pixel format: I420 when every file holds 4:2:0, GREY when every one is grey, else RGB24.
/// `rgb`: RGB24 in any case.
/// Errors: those of reading pictures; kHeadMismatch, with the file and the head, for a picture of another size than its
///   head's.
Result<std::vector<DecodedImage>> read_set(const std::vector<std::string>& files, const Calibration& calibration,
                                           bool rgb);

}  // namespace nodal::host
