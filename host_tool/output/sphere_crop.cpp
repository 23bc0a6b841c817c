#include "host_tool/output/sphere_crop.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "stitch/geometry/raymap/registry.h"
#include "stitch/media/image_file.h"

namespace nodal::host {
namespace {

constexpr int kMinSide = 2;  // px

}  // namespace

Result<CropChoice> parse_crop(const std::string& text) {
  if (text == "auto") return CropChoice{};
  if (text == "none") return CropChoice{CropChoice::Kind::kNone, {}};
  CropChoice choice{CropChoice::Kind::kPart, {}};
  bool large = false;
  const char *at = text.data(), *const end = text.data() + text.size();
  bool good = true;
  for (int* const number : {&choice.part.left, &choice.part.top, &choice.part.width, &choice.part.height}) {
    const auto [after, error] = std::from_chars(at, end, *number);
    const bool last = number == &choice.part.height;
    large = large || error == std::errc::result_out_of_range || *number > geometry::kMaxRaymapSide;
    good = good && error == std::errc() && *number >= 0 && (last ? after == end : after != end && *after == ',');
    if (!good) break;
    at = after + 1;
  }
  if (large) {
    return fail(Errc::kBadValue, fmt::format("'{}': spheres have at most {} pixels a side; give numbers up to that",
                                             text, geometry::kMaxRaymapSide));
  }
  if (!good || choice.part.width < kMinSide || choice.part.height < kMinSide) {
    return fail(Errc::kBadValue, "'" + text +
                                     "': write auto, none, or X,Y,W,H: the left upper corner and the size of the part, "
                                     "pixels of the whole sphere");
  }
  return choice;
}

DecodedImage cropped(const DecodedImage& whole, const RaymapPart& part) {
  if (has_chroma(whole.format)) {
    DecodedImage rgb = media::convert_image(whole.view(), PixelFormat::kRgb24);
    rgb.meaning = whole.meaning;
    rgb.metadata = whole.metadata;
    return cropped(rgb, part);
  }
  DecodedImage made{whole.format, part.width, part.height, {}, whole.meaning, whole.metadata};
  made.bytes.resize(packed_size(made.format, made.width, made.height));
  const auto pixel = static_cast<std::ptrdiff_t>(packed_size(made.format, 1, 1));
  const std::ptrdiff_t before_edge = std::min(part.width, whole.width - part.left);
  for (std::ptrdiff_t y = 0; y < part.height; ++y) {
    const auto row = whole.bytes.begin() + (part.top + y) * whole.width * pixel;
    const auto into = made.bytes.begin() + y * part.width * pixel;
    std::copy_n(row + part.left * pixel, before_edge * pixel, into);
    std::copy_n(row, (part.width - before_edge) * pixel, into + before_edge * pixel);
  }
  return made;
}

}  // namespace nodal::host
