// Pictures as relative light, at full size and repeatedly halved.
#pragma once

#include <vector>

#include "protocol/base/image.h"
#include "protocol/calibration.h"
#include "stitch/parallel/workers.h"
#include "stitch/registration/head_state.h"
#include "stitch/registration/tile_kernel.h"

namespace nodal::registration {

/// Relative light of one component, 0..255. Pixel (i, j) of level k covers 2^k by 2^k pixels of the picture.
struct Plane {
  int width = 0, height = 0;
  std::vector<float> values;
  PlaneRef ref() const { return {values.data(), width, height}; }
};

/// Luminance (channels 1) or red, green and blue (3) of a picture as light (its response is undone). Pixels outside the
/// region are replaced by the nearest pixel inside, so that blurs do not mix in black borders.
std::vector<Plane> light_of(const ImageView& image, const HeadCalibration& head, int channels);

/// Halves both sides; each pixel is centred on four pixels of the original.
Plane halved(const Plane& plane);
/// Gaussian blur, edge pixels repeated; sigma in the plane's pixels, 0: unchanged.
Plane blurred(const Plane& plane, double sigma);

/// The blur that a pyramid's level already has, as a variance per direction in its pixels squared: from the pixel's
/// area, the halvings, and the kernel's interpolation.
double level_variance(int level);

/// Gaussian blur of constant width in angle, `sigma_rad`, so that the pictures of one ray by two heads have the same
/// blur. A blur of constant width in pixels would displace detail, because the lens's local scale differs. Computed as
/// a constant Gaussian whose second moments are corrected, pixel by pixel, with the picture's second derivatives.
Plane blurred_in_angle(const Plane& plane, int level, const HeadState& head, double sigma_rad);

/// Every head's planes: levels[k][plane], plane = frame set * channels + channel.
struct HeadPyramid {
  std::vector<std::vector<Plane>> levels;
};

/// Makes at most kLevels levels; the shorter side of the last one has at least `smallest` pixels.
inline constexpr int kLevels = 6;
HeadPyramid make_pyramid(std::vector<Plane> planes, int smallest);

}  // namespace nodal::registration
