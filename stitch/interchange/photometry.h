// Light of heads in other programs' numbers: exposure, white balance, vignetting, response. Common to Hugin and
// VideoStitch.
#pragma once

#include <array>
#include <span>

#include "protocol/calibration.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {

enum class ForeignResponse : std::uint8_t {
  kMean,  ///< EMoR's mean over many cameras, as Hugin and VideoStitch have without fitted parameters
  kLinear,
  kGamma,
};

/// One picture: scene's light = response(value) * 2^stops / (V(r) * balance).
struct Photometry {
  double stops = 0;                        ///< exposure; a picture with more stops received less light
  std::array<double, 3> balance{1, 1, 1};  ///< red, green, blue
  std::array<double, 4> V{1, 0, 0, 0};     ///< factors of 1, r^2, r^4, r^6
  double Vx = 0, Vy = 0;                   ///< px from the picture's middle
  double radius = 1;                       ///< px where r = 1
  ForeignResponse response = ForeignResponse::kMean;
  double gamma = 1;
  bool fitted = false;  ///< the response has fitted parameters, which Nodal does not hold

  bool falls_off() const { return V[1] != 0 || V[2] != 0 || V[3] != 0; }
};

/// Sets gains relative to the rig's mean exposure, vignetting, and the response as far as it is known; notes vignetting
/// that is left out.
void set_photometry(std::span<const Photometry> all, ImportResult& result);

}  // namespace nodal::interchange
