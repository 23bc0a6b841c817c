#include "host_tool/input/picture_split.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "host_tool/input/pictures.h"
#include "protocol/base/try.h"
#include "stitch/autocalibration/image_circle.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/xmp/xmp.h"

namespace nodal::host {
namespace {

constexpr double kMaxStretch = 1.15;    // ratio of the halves' sides; sensors of 16 to 9 and wider are no square halves
constexpr double kMaxOffMiddle = 0.15;  // offset of a circle's middle, share of the half's side
constexpr int kLookedSide = 600;        // side of the reduced half, px: enough for a circle

void copy_rows(const PlaneView& from, int left, int top, const MutablePlaneView& to, std::size_t pixel_bytes) {
  for (int y = 0; y < to.height; ++y) {
    const std::uint8_t* row = from.data + (top + y) * from.row_stride + left * from.pixel_stride;
    std::copy_n(row, static_cast<std::size_t>(to.width) * pixel_bytes, to.data + y * to.row_stride);
  }
}

}  // namespace

Result<SplitChoice> parse_split(const std::string& text) {
  if (text == "auto") return SplitChoice{};
  if (text == "none") return SplitChoice{false, {}};
  SplitChoice choice{false, {0, 0}};
  const char* const end = text.data() + text.size();
  const auto [x, error] = std::from_chars(text.data(), end, choice.split.columns);
  bool good = error == std::errc() && x != end && *x == 'x';
  if (good) {
    const auto [at, wrong] = std::from_chars(x + 1, end, choice.split.rows);
    good = wrong == std::errc() && at == end;
  }
  const auto fits = [](int side) { return side >= 1 && side <= kMaxSplit; };
  if (!good || !fits(choice.split.columns) || !fits(choice.split.rows) || choice.split.count() < 2) {
    return fail(Errc::kBadValue, fmt::format("'{}': write auto, none, or how many pictures are beside and below each "
                                             "other in a file, such as 2x1 or 1x2; at most {} each",
                                             text, kMaxSplit));
  }
  return choice;
}

DecodedImage part_of(const DecodedImage& whole, const PictureSplit& split, std::size_t n) {
  const bool chroma = has_chroma(whole.format);
  const auto cut = [chroma](int side, int parts) { return chroma ? side / parts / 2 * 2 : side / parts; };
  DecodedImage part{whole.format, cut(whole.width, split.columns), cut(whole.height, split.rows), {}};
  part.meaning = whole.meaning;
  part.metadata = whole.metadata;
  part.bytes.resize(packed_size(part.format, part.width, part.height));
  const int left = static_cast<int>(n) % split.columns * part.width;
  const int top = static_cast<int>(n) / split.columns * part.height;
  const ImageView from = whole.view();
  const MutableImageView to = packed_image(part.format, part.width, part.height, part.bytes.data());
  if (!chroma) {
    copy_rows(from.planes[0], left, top, to.planes[0], packed_size(part.format, 1, 1));
    return part;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const int across = static_cast<int>(component_grid(part.format, static_cast<int>(c)).step_x);
    const int down = static_cast<int>(component_grid(part.format, static_cast<int>(c)).step_y);
    copy_rows(from.planes[c], left / across, top / down, to.planes[c], 1);
  }
  return part;
}

Result<PictureSplit> find_circles(const std::string& file) {
  const PictureSplit none;
  NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(file));
  NODAL_TRY_ASSIGN(const ImageHeader header, read_picture_header(bytes));
  const double shape = static_cast<double>(header.width) / header.height;
  const bool beside = shape > 2 / kMaxStretch && shape < 2 * kMaxStretch;
  const bool below = 1 / shape > 2 / kMaxStretch && 1 / shape < 2 * kMaxStretch;
  if ((!beside && !below) || std::min(header.width, header.height) < 16) return none;
  NODAL_TRY_ASSIGN(const DecodedImage whole, read_picture(file, PixelFormat::kGrey8));
  const PictureSplit two = beside ? PictureSplit{2, 1} : PictureSplit{1, 2};
  for (std::size_t n = 0; n < 2; ++n) {
    const autocalibration::Picture half = autocalibration::reduced(part_of(whole, two, n), kLookedSide);
    const auto circle = autocalibration::find_image_circle(half);
    // A single circle in the middle of a wide picture is no pair: its halves have their middle at an edge.
    if (!circle || std::abs(circle->x / half.width - 0.5) > kMaxOffMiddle ||
        std::abs(circle->y / half.height - 0.5) > kMaxOffMiddle) {
      return none;
    }
  }
  return two;
}

Error single_picture(const std::string& file) {
  Result<media::PictureBytes> bytes = media::PictureBytes::open(file);
  const Result<ImageHeader> header = bytes ? read_picture_header(*bytes) : Result<ImageHeader>(fail(bytes.error()));
  if (header && media::parse_xmp(header->metadata.xmp).area) {
    return {Errc::kBadValue, file + " is a sphere already, as its metadata says; see `nodal convert` and `nodal view`"};
  }
  const bool as_sphere = header && header->width == 2 * header->height;
  return {
      Errc::kBadValue,
      fmt::format(
          "{} is one picture, and no two circles of fisheyes are found in it; give two or more pictures that overlap, "
          "or, if it holds several pictures, say how they are arranged, such as --split 2x1{}",
          file,
          as_sphere ? "; if it is a sphere already, `nodal look`, `nodal view` and `nodal convert` take it with --from "
                      "equirectangular"
                    : "")};
}

std::vector<std::string> part_names(const PictureSplit& split) {
  if (split.columns == 2 && split.rows == 1) return {"left", "right"};
  if (split.columns == 1 && split.rows == 2) return {"top", "bottom"};
  std::vector<std::string> names;
  for (std::size_t n = 0; n < split.count(); ++n) names.push_back(fmt::format("part{}", n));
  return names;
}

}  // namespace nodal::host
