// The part of an equirectangular raymap that is written: the option --crop.
#pragma once

#include <string>

#include "host_tool/input/seen_part.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::host {

struct CropChoice {
  enum class Kind : std::uint8_t {
    kAuto,  ///< what is seen, if it is less than kMinSphereShare of the sphere
    kNone,
    kPart  ///< `part` of the whole sphere
  };
  Kind kind = Kind::kAuto;
  RaymapPart part{};
};

/// "auto", "none", or "X,Y,W,H", px. Errors: kBadValue.
Result<CropChoice> parse_crop(const std::string& text);

/// The part of a picture; one that reaches over the right edge goes on at the left one.
DecodedImage cropped(const DecodedImage& whole, const RaymapPart& part);

}  // namespace nodal::host
