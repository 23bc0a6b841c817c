// Pictures as relative light, at full size and in halves of halves.
#pragma once

#include <vector>

#include "protocol/base/image.h"
#include "protocol/calibration.h"
#include "stitch/registration/head_state.h"
#include "stitch/registration/parallel.h"
#include "stitch/registration/tile_kernel.h"

namespace nodal::registration {

/// Relative light of one component, 0..255. Pixel (i, j) of level k covers 2^k by 2^k pixels of the picture.
struct Plane {
  int width = 0, height = 0;
  std::vector<float> values;
  PlaneRef ref() const { return {values.data(), width, height}; }
};

/// Luminance (channels 1) or red, green and blue (3) of a picture, its response undone, what is outside the region
/// replaced by the nearest that is inside, so that no blur brings black borders in.
std::vector<Plane> light_of(const ImageView& image, const HeadCalibration& head, int channels);

/// Half the size both ways; each pixel is centred on its four.
Plane halved(const Plane& plane);
/// Gaussian, edges repeated; sigma in its own pixels, 0: unchanged.
Plane blurred(const Plane& plane, double sigma);

/// What blurs a picture of a pyramid's level already, in its own pixels squared a direction: the pixel itself, the
/// halvings, and the kernel's interpolation.
double level_variance(int level);

/// Gaussian of one width in angle, `sigma_rad`, whatever the lens makes of an angle there: two heads' pictures of one
/// ray are then blurred alike. A plain blur makes each head's detail lie a little elsewhere, by its own lens's stretch.
/// A constant Gaussian's second moments are put right, pixel by pixel, by the picture's own second derivatives.
Plane blurred_in_angle(const Plane& plane, int level, const HeadState& head, double sigma_rad);

/// Every head's planes: levels[k][plane], plane = frame set * channels + channel.
struct HeadPyramid {
  std::vector<std::vector<Plane>> levels;
};

/// The deepest level is still at least `smallest` pixels on its shorter side, and at most kLevels deep.
inline constexpr int kLevels = 6;
HeadPyramid make_pyramid(std::vector<Plane> planes, int smallest);

}  // namespace nodal::registration
