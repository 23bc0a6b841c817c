// One file that holds the pictures of several heads: two circles of a fisheye pair, or a grid.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// The pictures in one file, row by row.
struct PictureSplit {
  int columns = 1, rows = 1;
  std::size_t count() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }
};

inline constexpr int kMaxSplit = 8;  ///< columns or rows

/// What a user says of it: "auto", "none", or "2x1": columns x rows.
struct SplitChoice {
  bool find = true;  ///< a single file is looked at for two circles
  PictureSplit split;
};
/// Errors: kBadValue.
Result<SplitChoice> parse_split(const std::string& text);

/// The n-th picture, row by row. All have the same size: what does not divide is cut off at the right and below.
/// YUV is cut at even rows and columns.
DecodedImage part_of(const DecodedImage& whole, const PictureSplit& split, std::size_t n);

/// Whether a file shows two circles of fisheyes, side by side or one above the other, which may be cut by its edges.
/// Decodes it if its sides are about 2 to 1. Errors: those of reading it.
Result<PictureSplit> find_circles(const std::string& file);

/// What a single file is if no circles are found in it, with what to do.
Error single_picture(const std::string& file);

/// Names for the parts, as heads: left and right, top and bottom, or part0 and so on.
std::vector<std::string> part_names(const PictureSplit& split);

}  // namespace nodal::host
