// Masks of pictures, as people draw them: a PNG beside a picture, or its alpha channel.
#pragma once

#include <string>
#include <vector>

#include "host_tool/input/rig_pictures.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// The mask that belongs to a picture: a.mask.png to a.jpg.
std::string mask_file_of(const std::string& picture);

/// Arguments without masks, as a shell lists them with *.png.
/// Errors: kBadValue for a mask whose picture is not among the arguments.
Result<std::vector<std::string>> without_masks(const std::vector<std::string>& arguments);

/// What masks hide of a head's pictures.
struct HeadMask {
  std::vector<std::vector<Region::Point>> polygons;  ///< px of the head's picture
  std::string from;                                  ///< "a.mask.png", "the alpha channel of a.png"; empty: no mask
  double share = 0;                                  ///< share of the picture's pixels
};

/// The masks of every head: of the files beside all its pictures, and of the alpha channel of its picture in one set.
/// Black and transparent pixels are hidden: a mask's, where its luminance times its opacity is below half of white, a
/// picture's, where its opacity is below half. A mask has its picture's size, and shows what people see: where the
/// picture's Exif says that it is turned by 90, 180 or 270 degrees, the mask is turned with it.
/// Errors: those of reading the files; kHeadMismatch for a mask of another size; kBadValue for masks that hide all of a
///   head; kTooLarge for masks that polygons of a calibration cannot follow; each names the file and what to do.
Result<std::vector<HeadMask>> find_masks(std::vector<std::vector<HeadPicture>>& sets,
                                         const std::vector<std::string>& heads, std::size_t alpha_set);

/// One sentence of what is hidden in which head; empty if nothing is.
std::string describe(const std::vector<HeadMask>& masks, const std::vector<std::string>& heads);

/// Adds the pictures' masks to the calibration of their heads, with a note.
/// Errors: those of find_masks(), with alpha channels of the first set; kBadValue if nothing of a head is left.
Status add_picture_masks(RigPictures& rig);

}  // namespace nodal::host
