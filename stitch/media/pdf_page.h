// A grey picture as a PDF page.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::media {

/// 8-bit grey, rows packed.
struct GreyRaster {
  int width = 0;
  int height = 0;
  std::span<const std::uint8_t> values;
};

/// A page of width x height millimetres with the raster in its middle, as large as the margin `margin_mm` allows, in
/// sRGB, without interpolation; `footer` (ASCII) is printed below it in small type.
/// Errors: kBadValue when the margins leave no room; kInternal.
Result<std::vector<std::uint8_t>> grey_pdf(const GreyRaster& raster, double page_width_mm, double page_height_mm,
                                           double margin_mm, std::string_view footer);

}  // namespace nodal::media
