#include "host_tool/commands/picture_file.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <optional>

#include "host_tool/commands/result_file.h"
#include "host_tool/console/files.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/image.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

constexpr std::uint32_t kMaxRaymapSide = 16384;       // rig.toml's limit for raymap.width
constexpr std::uint64_t kMaxJpegOverhead = 1U << 20;  // bytes of a JPEG beside its pixels: headers, metadata

std::optional<PixelFormat> raw_format(const std::string& coding) {
  for (const PixelFormat format : {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kRgb24, PixelFormat::kGrey8,
                                   PixelFormat::kRgb48, PixelFormat::kGrey16}) {
    if (coding == pixel_format_name(format)) return format;
  }
  return std::nullopt;
}

Result<std::vector<std::uint8_t>> encode_received(const ReceivedRaymap& raymap, RaymapFormat as) {
  const wire::RaymapHeader& header = raymap.header;
  const std::optional<PixelFormat> format = raw_format(header.coding());
  if (!format) return fail(Errc::kUnsupported, fmt::format("a raymap of coding '{}'", header.coding()));
  DecodedImage image{*format, static_cast<int>(header.width()), static_cast<int>(header.height()), raymap.bytes};
  if (is_linear16(*format)) image.meaning = SampleMeaning::linear();
  if (header.has_full_exposure_ns()) image.meaning.full_exposure_ns = header.full_exposure_ns();
  ResultFile file;
  file.format = as;
  file.whole_sphere = header.layout() == "equirectangular";
  return encode_result(image, file);
}

}  // namespace

Result<RaymapFormat> parse_raymap_format(std::string_view text) {
  if (text == "jpg") return RaymapFormat::kJpg;
  if (text == "png") return RaymapFormat::kPng;
  if (text == "tif") return RaymapFormat::kTiff;
  if (text == "raw") return RaymapFormat::kRaw;
  return fail(Errc::kBadValue, fmt::format("format '{}': it is jpg, png, tif or raw", text));
}

Result<RaymapFormat> raymap_format_of_name(std::string_view name) {
  if (has_ending(name, ".jpg") || has_ending(name, ".jpeg")) return RaymapFormat::kJpg;
  if (has_ending(name, ".png")) return RaymapFormat::kPng;
  if (has_ending(name, ".tif") || has_ending(name, ".tiff")) return RaymapFormat::kTiff;
  if (has_ending(name, ".raw") || has_ending(name, ".yuv")) return RaymapFormat::kRaw;
  return fail(Errc::kBadValue, fmt::format("'{}': end it in .jpg, .png, .tif or .raw", name));
}

std::string_view ending_of(RaymapFormat format) {
  switch (format) {
    case RaymapFormat::kJpg: return "jpg";
    case RaymapFormat::kPng: return "png";
    case RaymapFormat::kTiff: return "tif";
    case RaymapFormat::kRaw: break;
  }
  return "raw";
}

Status check_pipe(const Console& console) {
  if (console.json()) return fail(Errc::kBadValue, "--out - and --json both want standard output");
  if (!console.out_is_terminal()) return {};
  return fail(Errc::kBadValue, "--out - would write pictures on the terminal; send it on: | ffplay -f mjpeg -");
}

Status check_output(const std::string& out, const std::vector<std::vector<std::string>>& sets, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const Result<std::string> name = numbered_name(out, i);
    if (!name) return fail(name.error().in("--out"));
    for (const auto& set : sets) {
      for (const std::string& picture : set) {
        std::error_code error;
        if (!std::filesystem::equivalent(*name, picture, error)) continue;
        return fail(Errc::kExists, fmt::format("--out: {} is one of the pictures; choose another name", *name));
      }
    }
  }
  return {};
}

Result<std::uint64_t> most_raymap_bytes(const wire::RaymapHeader& header) {
  if (header.width() == 0 || header.height() == 0 || header.width() > kMaxRaymapSide ||
      header.height() > kMaxRaymapSide) {
    return fail(Errc::kBadFormat, fmt::format("raymap of set {}: {}×{} is not a valid size", header.set(),
                                              header.width(), header.height()));
  }
  if (header.coding() == "jpeg") return std::uint64_t{header.width()} * header.height() * 3 + kMaxJpegOverhead;
  const std::optional<PixelFormat> format = raw_format(header.coding());
  if (!format) {
    return fail(Errc::kUnsupported, fmt::format("raymap of set {}: the coding '{}' is unknown; is the rig newer "
                                                "than this program?",
                                                header.set(), header.coding()));
  }
  return packed_size(*format, static_cast<int>(header.width()), static_cast<int>(header.height()));
}

Status check_raymap(const ReceivedRaymap& raymap) {
  const wire::RaymapHeader& header = raymap.header;
  const std::size_t size = raymap.bytes.size();
  NODAL_TRY_ASSIGN(const std::uint64_t wanted, most_raymap_bytes(header));
  if (header.coding() == "jpeg") {
    const auto& b = raymap.bytes;
    if (size < 4 || b[0] != 0xFF || b[1] != 0xD8) {
      return fail(Errc::kBadFormat, fmt::format("raymap of set {}: it does not begin as a JPEG", header.set()));
    }
    if (b[size - 2] != 0xFF || b[size - 1] != 0xD9) {
      return fail(Errc::kTruncated, fmt::format("raymap of set {}: its JPEG has no end", header.set()));
    }
    return {};
  }
  if (size != wanted) {
    return fail(Errc::kTruncated, fmt::format("raymap of set {}: {} bytes instead of {}", header.set(), size, wanted));
  }
  return {};
}

Result<std::vector<std::uint8_t>> encode_png(const ReceivedRaymap& raymap) {
  Result<std::vector<std::uint8_t>> file = encode_received(raymap, RaymapFormat::kPng);
  if (!file) return fail(file.error().in("PNG"));
  return file;
}

Result<std::vector<std::uint8_t>> encode_tiff(const ReceivedRaymap& raymap) {
  Result<std::vector<std::uint8_t>> file = encode_received(raymap, RaymapFormat::kTiff);
  if (!file) return fail(file.error().in("TIFF"));
  return file;
}

std::string raw_sidecar(const ReceivedRaymap& raymap) {
  Json json = to_json(raymap.header);
  const std::optional<PixelFormat> format = raw_format(raymap.header.coding());
  Json planes = Json::array();
  if (format) {
    const ImageView view = packed_image(*format, static_cast<int>(raymap.header.width()),
                                        static_cast<int>(raymap.header.height()), raymap.bytes.data());
    const bool rgb = in_8_bits(*format) == PixelFormat::kRgb24;
    const std::array<std::string_view, 3> names =
        rgb ? std::array<std::string_view, 3>{"R", "G", "B"} : std::array<std::string_view, 3>{"Y", "U", "V"};
    for (int c = 0; c < component_count(*format); ++c) {
      const PlaneView& plane = view.planes[static_cast<std::size_t>(c)];
      planes.push_back({{"component", names[static_cast<std::size_t>(c)]},
                        {"offset", plane.data - raymap.bytes.data()},
                        {"width", plane.width},
                        {"height", plane.height},
                        {"row_stride", plane.row_stride},
                        {"pixel_stride", plane.pixel_stride}});
    }
  }
  json["planes"] = planes;
  json["range"] = "full";
  const bool linear = format && is_linear16(*format);
  json["bits"] = linear ? 16 : 8;
  if (linear) {
    json["byte_order"] = "little";
    json["numbers"] = "linear";
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace nodal::host
