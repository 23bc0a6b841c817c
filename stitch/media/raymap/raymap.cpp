#include "stitch/media/raymap/raymap.h"

#include <array>
#include <nlohmann/json.hpp>
#include <string_view>

namespace nodal::media {

using Json = nlohmann::ordered_json;

std::optional<PixelFormat> raw_format(const RaymapMeta& meta) {
  for (const PixelFormat format : {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kRgb24, PixelFormat::kGrey8,
                                   PixelFormat::kRgb48, PixelFormat::kGrey16}) {
    if (meta.coding == pixel_format_name(format)) return format;
  }
  return std::nullopt;
}

Json to_json(const RaymapMeta& meta) {
  Json heads = Json::array();
  for (std::uint32_t head = 0; head < 32; ++head) {
    if ((meta.heads_mask >> head & 1U) != 0) heads.push_back(head);
  }
  Json json = {{"set", meta.set},
               {"mid_exposure_ns", meta.mid_exposure_ns},
               {"coding", meta.coding},
               {"width", meta.width},
               {"height", meta.height},
               {"layout", meta.layout},
               {"calibration_id", meta.calibration_id ? to_hex(*meta.calibration_id) : std::string()},
               {"heads", heads},
               {"spread_ns", meta.spread_ns},
               {"genlock", meta.genlock}};
  if (meta.field) {
    json["field"] = *meta.field;
    json["parity"] = meta.parity;
  }
  if (meta.trigger) json["trigger"] = *meta.trigger;
  if (meta.begin_spread_ns) json["begin_spread_ns"] = *meta.begin_spread_ns;
  if (meta.drift_ppb) json["drift_ppb"] = *meta.drift_ppb;
  if (meta.full_exposure_ns) json["full_exposure_ns"] = *meta.full_exposure_ns;
  json["exposure_ns"] = meta.exposure_ns;
  json["gain_mdb"] = meta.gain_mdb;
  json["offset_ns"] = meta.offset_ns;
  return json;
}

std::string raw_sidecar(const Raymap& raymap) {
  Json json = to_json(raymap.meta);
  const std::optional<PixelFormat> format = raw_format(raymap.meta);
  Json planes = Json::array();
  if (format) {
    const ImageView view = packed_image(*format, raymap.meta.width, raymap.meta.height, raymap.bytes.data());
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

}  // namespace nodal::media
