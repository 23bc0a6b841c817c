// The meaning of Panorama Tools' numbers in Hugin and PTGui: lens, centre, region and pose of one image.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/interchange/panotools_script.h"

namespace nodal::interchange {

/// The rectangle of pixels to which lens and region refer; coordinates of edges, not of pixel centres.
struct Crop {
  double left = 0, right = 0, top = 0, bottom = 0;
};

/// The geometry variables of one image, with the file's values.
struct PanotoolsImage {
  std::string name;  ///< name that the head gets
  int width = 0;     ///< width of the picture, px
  int height = 0;
  int projection = 0;  ///< f: 0 rectilinear, 2 circular and 3 full-frame fisheye
  double hfov = 0;     ///< v, degrees, across the lens's rectangle
  double a = 0, b = 0, c = 0;
  double d = 0, e = 0;
  double yaw = 0, pitch = 0, roll = 0;
  Crop lens;                   ///< the rectangle to which v, a..c, d and e refer
  std::optional<Crop> region;  ///< the part of the picture that the user selected; a circle for f2
};

/// Reads v, a..e, f, y, p, r of an image line and resolves links; f is 0 if no line sets it.
Status read_geometry(const ImageLines& images, std::size_t image, PanotoolsImage& out);

/// Sets lens, centre, pose and region; response, vignetting and gain keep their defaults. With N = min(W, H) / 2 of the
/// lens's rectangle and r_ideal = f tan t (f0) or f t (f2, f3):
///   r = N (a p^4 + b p^3 + c p^2 + (1 - a - b - c) p),  p = r_ideal / N
/// which is a polynomial in tan t or t, so the conversion is exact. d, e shift the centre from the rectangle's middle.
Result<HeadCalibration> to_head(const PanotoolsImage& image, std::vector<std::string>& notes);

/// A head's name from a picture's path: no folder, no extension, only A-Z a-z 0-9 . _ -, and not in `taken`.
std::string head_name(std::string_view path, const std::vector<std::string>& taken);

}  // namespace nodal::interchange
