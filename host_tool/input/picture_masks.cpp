#include "host_tool/input/picture_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <set>
#include <utility>

#include "host_tool/input/pictures.h"
#include "protocol/base/try.h"
#include "stitch/geometry/mask_outline.h"
#include "stitch/geometry/masks.h"
#include "stitch/media/exif/exif.h"
#include "stitch/media/heif_webp/reader.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/picture_folder.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;
using geometry::HiddenPixels;
using Polygons = std::vector<std::vector<Region::Point>>;

constexpr int kHalf = 128;          // half of 255
constexpr int kVisiblePlaces = 96;  // along each side of a region, to see whether anything of it is visible

/// What a picture's file says of its size and attitude.
struct Stored {
  int width = 0, height = 0;
  int orientation = 1;
};

Result<Stored> stored_of(const std::string& file) {
  NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(file));
  NODAL_TRY_ASSIGN(const ImageHeader header, read_picture_header(bytes));
  if (media::is_heif_or_webp(bytes)) {
    const int said = media::exif_of(header.metadata).orientation;
    return Stored{header.width, header.height, media::is_turned(bytes) ? 1 : said};
  }
  NODAL_TRY_ASSIGN(const auto start, bytes.first(media::kExifBytes));
  return Stored{header.width, header.height, media::parse_exif(start).orientation};
}

/// Turned clockwise by 90 degrees, `quarters` times.
DecodedImage turned(DecodedImage grey, int quarters) {
  for (; quarters > 0; --quarters) {
    DecodedImage next{grey.format, grey.height, grey.width, std::vector<std::uint8_t>(grey.bytes.size())};
    for (int y = 0; y < grey.height; ++y) {
      for (int x = 0; x < grey.width; ++x) {
        next.bytes[static_cast<std::size_t>(x) * static_cast<std::size_t>(grey.height) +
                   static_cast<std::size_t>(grey.height - 1 - y)] =
            grey.bytes[static_cast<std::size_t>(y) * static_cast<std::size_t>(grey.width) +
                       static_cast<std::size_t>(x)];
      }
    }
    grey = std::move(next);
  }
  return grey;
}

/// Quarter turns, clockwise, from a picture as it is seen to its stored pixels (Exif orientation).
int quarters_to_stored(int orientation) {
  switch (orientation) {
    case 3: return 2;
    case 6: return 3;
    case 8: return 1;
    default: return 0;
  }
}

/// A mask as its picture's pixels are stored: luminance times opacity, GREY.
Result<DecodedImage> read_mask(const std::string& file, const std::string& picture) {
  NODAL_TRY_ASSIGN(const Stored stored, stored_of(picture));
  NODAL_TRY_ASSIGN(DecodedImage mask, read_picture(file, PixelFormat::kGrey8));
  NODAL_TRY_ASSIGN(const auto opacity, read_opacity(file));
  if (opacity) {
    std::ranges::transform(mask.bytes, opacity->bytes, mask.bytes.begin(), [](std::uint8_t value, std::uint8_t alpha) {
      return static_cast<std::uint8_t>(value * alpha / 255);
    });
  }
  const int quarters = quarters_to_stored(stored.orientation);
  const bool on_its_side = quarters % 2 == 1;
  const bool as_stored = mask.width == stored.width && mask.height == stored.height;
  const bool as_seen = on_its_side ? mask.width == stored.height && mask.height == stored.width : as_stored;
  if (!as_stored && !as_seen) {
    return fail(
        Errc::kHeadMismatch,
        fmt::format("{}: the mask has {}x{} pixels, and its picture {} has {}x{}; draw it at the picture's size", file,
                    mask.width, mask.height, picture, stored.width, stored.height));
  }
  return as_seen ? turned(std::move(mask), quarters) : std::move(mask);
}

/// The hidden pixels of one head, from all its masks.
class Hidden {
 public:
  explicit Hidden(std::string head) : head_(std::move(head)) {}

  /// Pixels of `grey` that are below half are hidden. `from`: what it is, in words.
  /// Errors: kHeadMismatch if the pictures of the head have different sizes.
  Status add(const DecodedImage& grey, const std::string& from) {
    if (pixels_.values.empty()) {
      pixels_ = {grey.width, grey.height, std::vector<std::uint8_t>(grey.bytes.size())};
    } else if (pixels_.width != grey.width || pixels_.height != grey.height) {
      return fail(Errc::kHeadMismatch, fmt::format("{}: the masks of head '{}' have different sizes", from, head_));
    }
    bool any = false;
    for (std::size_t k = 0; k < grey.bytes.size(); ++k) {
      if (grey.bytes[k] >= kHalf) continue;
      pixels_.values[k] = 1;
      any = true;
    }
    if (any) from_ += (from_.empty() ? "" : ", ") + from;
    return {};
  }

  Result<HeadMask> mask() const {
    const auto hidden = static_cast<std::size_t>(std::ranges::count(pixels_.values, 1));
    if (hidden == 0) return HeadMask{};
    if (hidden == pixels_.values.size()) {
      return fail(Errc::kBadValue,
                  fmt::format("masks hide all of head '{}' ({}); what is black or transparent in a mask is not used, "
                              "what is white is: invert it, or remove it",
                              head_, from_));
    }
    auto outline = geometry::outline_of(pixels_);
    if (!outline) return fail(outline.error().in(from_));
    return HeadMask{std::move(outline->polygons), from_,
                    static_cast<double>(hidden) / static_cast<double>(pixels_.values.size())};
  }

 private:
  std::string head_, from_;
  HiddenPixels pixels_;
};

bool is_there(const std::string& file) {
  std::error_code error;
  return fs::is_regular_file(file, error);
}

std::string file_name(const std::string& file) { return fs::path(file).filename().string(); }

/// Whether a point of the region is visible.
bool shows_something(const Region& region) {
  const geometry::Masks masks(region);
  for (int j = 0; j < kVisiblePlaces; ++j) {
    for (int i = 0; i < kVisiblePlaces; ++i) {
      const geometry::Pixel at{region.left + (region.right - region.left) * (i + 0.5) / kVisiblePlaces,
                               region.top + (region.bottom - region.top) * (j + 0.5) / kVisiblePlaces};
      const auto& circle = region.circle;
      if (circle && std::hypot(at.x - circle->x, at.y - circle->y) > circle->radius) continue;
      if (masks.distance(at, 1) > 0) return true;
    }
  }
  return false;
}

/// As many polygons as a calibration may have, for both lists together.
Result<Polygons> joined(const HeadCalibration& head, const HeadMask& mask) {
  Polygons all = head.region.masks;
  all.insert(all.end(), mask.polygons.begin(), mask.polygons.end());
  std::size_t corners = 0;
  for (const auto& polygon : all) corners += polygon.size();
  if (all.size() <= kMaxMasks && corners <= kMaxMaskPoints) return all;
  const geometry::Masks masks(Region{0, 0, double(head.width), double(head.height), {}, std::move(all)});
  HiddenPixels pixels{head.width, head.height, {}};
  for (int y = 0; y < head.height; ++y) {
    for (int x = 0; x < head.width; ++x) pixels.values.push_back(masks.distance({x + 0.5, y + 0.5}, 1) < 0 ? 1 : 0);
  }
  auto outline = geometry::outline_of(pixels);
  if (!outline) return fail(outline.error().in(mask.from + ", with the masks of the calibration"));
  return std::move(outline->polygons);
}

}  // namespace

std::string mask_file_of(const std::string& picture) {
  return fs::path(picture).replace_extension(".mask.png").string();
}

Result<std::vector<std::string>> without_masks(const std::vector<std::string>& arguments) {
  std::vector<std::string> pictures;
  std::ranges::copy_if(arguments, std::back_inserter(pictures),
                       [](const std::string& file) { return !media::is_mask_name(file); });
  for (const std::string& file : arguments) {
    if (!media::is_mask_name(file)) continue;
    const auto its = [&](const std::string& picture) {
      return fs::path(mask_file_of(picture)).lexically_normal() == fs::path(file).lexically_normal();
    };
    if (std::ranges::none_of(pictures, its)) {
      return fail(Errc::kBadValue,
                  fmt::format("{}: this is a mask by its name, and its picture is not given; a.mask.png is the mask of "
                              "a.jpg",
                              file));
    }
  }
  return pictures;
}

Result<std::vector<HeadMask>> find_masks(std::vector<std::vector<HeadPicture>>& sets,
                                         const std::vector<std::string>& heads, std::size_t alpha_set) {
  std::vector<HeadMask> masks;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    Hidden hidden(heads[h]);
    for (std::size_t set = 0; set < sets.size(); ++set) {
      HeadPicture& picture = sets[set][h];
      if (picture.file().empty()) continue;
      const std::string file = mask_file_of(picture.file());
      if (is_there(file)) {
        NODAL_TRY_ASSIGN(const DecodedImage mask, read_mask(file, picture.file()));
        NODAL_TRY(hidden.add(picture.own_part(mask), file_name(file)));
      }
      if (set != alpha_set) continue;
      NODAL_TRY_ASSIGN(const auto opacity, picture.opacity());
      if (!opacity) continue;
      NODAL_TRY(hidden.add(picture.own_part(*opacity), "the alpha channel of " + file_name(picture.file())));
    }
    NODAL_TRY_ASSIGN(HeadMask mask, hidden.mask());
    masks.push_back(std::move(mask));
  }
  return masks;
}

std::string describe(const std::vector<HeadMask>& masks, const std::vector<std::string>& heads) {
  std::string text;
  for (std::size_t h = 0; h < masks.size(); ++h) {
    if (masks[h].from.empty()) continue;
    text += fmt::format("{}{:.2g} % of head '{}' ({})", text.empty() ? "masks hide " : ", ", 100 * masks[h].share,
                        heads[h], masks[h].from);
  }
  return text;
}

Status add_picture_masks(RigPictures& rig) {
  NODAL_TRY_ASSIGN(const auto masks, find_masks(rig.sets, rig.heads, 0));
  for (std::size_t h = 0; h < masks.size(); ++h) {
    if (masks[h].polygons.empty()) continue;
    HeadCalibration& head = rig.calibration.heads[h];
    NODAL_TRY_ASSIGN(head.region.masks, joined(head, masks[h]));
    if (!shows_something(head.region)) {
      return fail(Errc::kBadValue, fmt::format("masks hide all of head '{}' ({}) that its calibration's region shows",
                                               head.name, masks[h].from));
    }
    if (const Status good = check_head(head); !good) return fail(good.error().in(masks[h].from));
  }
  if (const std::string note = describe(masks, rig.heads); !note.empty()) rig.notes.push_back(note);
  return {};
}

}  // namespace nodal::host
