#include "stitch/media/xmp/xmp.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <pugixml.hpp>
#include <string>

namespace nodal::media {
namespace {

constexpr std::size_t kMaxValueBytes = 256;

/// A property that results keep.
struct Kept {
  std::string_view name;  ///< with the prefix that gpano_packet() gives its namespace
  bool degrees = false;   ///< a number; otherwise any words
};
constexpr std::array kKept{
    Kept{"GPano:PoseHeadingDegrees", true},
    Kept{"GPano:PosePitchDegrees", true},
    Kept{"GPano:PoseRollDegrees", true},
    Kept{"GPano:InitialViewHeadingDegrees", true},
    Kept{"GPano:InitialViewPitchDegrees", true},
    Kept{"GPano:InitialViewRollDegrees", true},
    Kept{"GPano:InitialHorizontalFOVDegrees", true},
    Kept{"GPano:CaptureSoftware"},
    Kept{"GPano:FirstPhotoDate"},
    Kept{"GPano:LastPhotoDate"},
    Kept{"GPano:SourcePhotosCount"},
    Kept{"exif:DateTimeOriginal"},
    Kept{"exif:DateTimeDigitized"},
    Kept{"exif:GPSLatitude"},
    Kept{"exif:GPSLongitude"},
    Kept{"exif:GPSAltitude"},
    Kept{"exif:GPSAltitudeRef"},
    Kept{"exif:GPSTimeStamp"},
    Kept{"xmp:CreateDate"},
    Kept{"photoshop:DateCreated"},
};

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n";
  const std::size_t from = text.find_first_not_of(kSpace);
  if (from == std::string_view::npos) return {};
  return text.substr(from, text.find_last_not_of(kSpace) + 1 - from);
}

std::optional<double> number_of(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::string_view prefix_of(std::string_view name) {
  const std::size_t colon = name.find(':');
  return colon == std::string_view::npos ? std::string_view() : name.substr(0, colon);
}

/// The namespace that a prefix stands for at a node; empty if nothing says it.
std::string_view namespace_of(pugi::xml_node node, std::string_view prefix) {
  const std::string attribute = "xmlns:" + std::string(prefix);
  for (int up = 0; node && up <= kMaxXmpDepth + 1; ++up, node = node.parent()) {
    if (const pugi::xml_attribute said = node.attribute(attribute.c_str())) return said.value();
  }
  return {};
}

/// The name with the prefix that gpano_packet() uses; empty for names of other namespaces.
std::string known_name(pugi::xml_node node, std::string_view name) {
  const std::string_view prefix = prefix_of(name);
  if (prefix.empty()) return {};
  const std::string_view where = namespace_of(node, prefix);
  for (const XmpNamespace& known : kXmpNamespaces) {
    if (where == known.uri) return std::string(known.prefix) + std::string(name.substr(prefix.size()));
  }
  return {};
}

class Collector final : public pugi::xml_tree_walker {
 public:
  bool for_each(pugi::xml_node& node) override {
    if (node.type() != pugi::node_element || depth() > kMaxXmpDepth) return true;
    for (const pugi::xml_attribute attribute : node.attributes()) {
      take(known_name(node, attribute.name()), trimmed(attribute.value()));
    }
    if (!node.first_child() || node.first_child().type() == pugi::node_pcdata) {
      take(known_name(node, node.name()), trimmed(node.child_value()));
    }
    return true;
  }

  XmpWords words() && {
    if (equirectangular_) words_.area = area_;
    return std::move(words_);
  }

 private:
  void take(const std::string& name, std::string_view value) {
    if (name.empty() || value.empty() || value.size() > kMaxValueBytes) return;
    if (name == "GPano:ProjectionType") equirectangular_ = value == "equirectangular";
    for (const auto& [field, into] : {std::pair("GPano:FullPanoWidthPixels", &area_.full_width),
                                      {"GPano:FullPanoHeightPixels", &area_.full_height},
                                      {"GPano:CroppedAreaLeftPixels", &area_.left},
                                      {"GPano:CroppedAreaTopPixels", &area_.top},
                                      {"GPano:CroppedAreaImageWidthPixels", &area_.width},
                                      {"GPano:CroppedAreaImageHeightPixels", &area_.height}}) {
      if (name != field) continue;
      constexpr double kMax = 1e9;
      const std::optional<double> number = number_of(value);
      if (number && std::abs(*number) <= kMax) *into = std::llround(*number);
    }
    const auto* const kept = std::ranges::find(kKept, name, &Kept::name);
    if (kept == kKept.end() || std::ranges::find(words_.kept, name, &XmpProperty::name) != words_.kept.end()) return;
    if (kept->degrees) {
      const std::optional<double> degrees = number_of(value);
      if (!degrees || std::abs(*degrees) > 360) return;
    }
    words_.kept.push_back({name, std::string(value)});
  }

  XmpWords words_;
  SphereArea area_;
  bool equirectangular_ = false;
};

}  // namespace

XmpWords parse_xmp(std::string_view packet) {
  packet = packet.substr(0, kMaxXmpBytes);
  pugi::xml_document document;
  document.load_buffer(packet.data(), packet.size());  // broken XML leaves what was parsed before the error
  Collector collector;
  document.traverse(collector);
  return std::move(collector).words();
}

}  // namespace nodal::media
