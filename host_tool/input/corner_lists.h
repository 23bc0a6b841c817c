// Corners of a board in photographs, as another program found them: a list in CSV.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/calibration/lens/corner_views.h"

namespace nodal::host {

/// "picture,x,y,board_x,board_y"; a sixth column, board_z, must be the same in all rows of a picture: the board is
/// flat.
inline constexpr const char* kCornerColumns = "picture,x,y,board_x,board_y";

/// The rows by picture, in the order of their first rows. x and y are pixels of the picture, with the centre of the
/// first one at (0.5, 0.5). A first line without numbers is a heading; empty lines and those that begin with # are
/// skipped.
/// Errors: kBadFormat, kBadValue, with the line; kTooLarge for more than kMaxCorners rows.
Result<std::vector<calibration::CornerView>> parse_corner_list(const std::string& text);

inline constexpr std::size_t kMaxCorners = 1'000'000;
inline constexpr std::size_t kMaxCornerListBytes = std::size_t{64} << 20;

struct CornerList {
  std::vector<calibration::CornerView> views;
  int width = 0, height = 0;  ///< size of the pictures, which are read relative to the list's folder
};

/// Errors: those of reading the list and the headers of its pictures; kBadValue for pictures of different sizes, and
/// for corners outside of their picture.
Result<CornerList> read_corner_list(const std::string& file);

}  // namespace nodal::host
