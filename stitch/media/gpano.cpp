#include "stitch/media/gpano.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/limits.h"
#include "stitch/media/xml_text.h"

namespace nodal::media {
namespace {

std::int64_t slack(std::int64_t whole) { return std::max(kAreaSlack, whole / kAreaSlackPart); }

/// Moves and cuts an area that does not fit by rounding. Whether it fits then.
bool fit(SphereArea& area) {
  constexpr std::int64_t kMax = std::int64_t{1} << 32;
  for (const std::int64_t whole : {area.full_width, area.full_height}) {
    if (whole <= 0 || whole > kMax) return false;
  }
  const std::int64_t down = slack(area.full_height);
  if (area.width <= 0 || area.width > area.full_width + slack(area.full_width)) return false;
  if (area.height <= 0 || area.height > area.full_height + down) return false;
  if (area.left <= -area.full_width || area.left >= 2 * area.full_width) return false;
  if (area.top < -down || area.top + area.height > area.full_height + down) return false;
  area.left = (area.left + area.full_width) % area.full_width;
  area.top = std::max<std::int64_t>(0, std::min(area.top, area.full_height - area.height));
  return true;
}

}  // namespace

Result<DecodedImage> whole_sphere(DecodedImage part, const SphereArea& said) {
  SphereArea area = said;
  if (area.full_width == 0 || area.full_height == 0 || area.width == 0 || area.height == 0) return part;
  if (area.left == 0 && area.top == 0 && area.width == area.full_width && area.height == area.full_height) return part;
  if (!fit(area)) {
    return fail(Errc::kBadFormat,
                fmt::format("its metadata says that it shows {}x{} px from {}, {} on of a sphere of {}x{}; --from "
                            "equirectangular takes it for a whole one",
                            area.width, area.height, area.left, area.top, area.full_width, area.full_height));
  }
  // The picture may have been resized since.
  const double across = static_cast<double>(part.width) / static_cast<double>(area.width);
  const double down = static_cast<double>(part.height) / static_cast<double>(area.height);
  const auto scaled = [](std::int64_t value, double by) -> std::int64_t {
    return std::llround(static_cast<double>(value) * by);
  };
  const std::int64_t width = scaled(area.full_width, across);
  const std::int64_t height = scaled(area.full_height, down);
  if (width < 1 || height < 1 || width > std::int64_t{1} << 30 || height > std::int64_t{1} << 30 ||
      static_cast<std::uint64_t>(width * height) > kMaxPicturePixels) {
    return fail(Errc::kTooLarge,
                fmt::format("the sphere of which it shows a part has {}x{} pixels, over the limit of 512 * 2^20", width,
                            height));
  }
  // What is wider or higher than the sphere is cut at the right and at the bottom.
  const std::int64_t columns = std::min<std::int64_t>(part.width, width);
  const std::int64_t rows = std::min<std::int64_t>(part.height, height);
  const std::int64_t left = std::min(scaled(area.left, across), width - 1);
  const std::int64_t top = std::min(scaled(area.top, down), height - rows);
  const std::int64_t before_edge = std::min(columns, width - left);
  DecodedImage whole{part.format, static_cast<int>(width), static_cast<int>(height), {}};
  whole.meaning = part.meaning;
  whole.metadata = part.metadata;
  whole.bytes.resize(packed_size(whole.format, whole.width, whole.height));
  const auto bytes = static_cast<std::int64_t>(packed_size(part.format, 1, 1));
  for (std::int64_t y = 0; y < rows; ++y) {
    const auto from = part.bytes.begin() + y * part.width * bytes;
    const auto row = whole.bytes.begin() + (top + y) * width * bytes;
    std::copy_n(from, before_edge * bytes, row + left * bytes);
    std::copy_n(from + before_edge * bytes, (columns - before_edge) * bytes, row);
  }
  return whole;
}

std::string xmp_packet(const XmpProperties& properties) {
  if (properties.empty()) return {};
  std::string packet =
      "<?xpacket begin=\"\xef\xbb\xbf\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\n"
      "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\" x:xmptk=\"Nodal\">\n"
      " <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n"
      "  <rdf:Description rdf:about=\"\"";
  for (const XmpNamespace& space : kXmpNamespaces) {
    const auto named = [&](const XmpProperty& property) {
      return property.name.starts_with(std::string(space.prefix) + ":");
    };
    if (std::ranges::none_of(properties, named)) continue;
    packet += " xmlns:" + std::string(space.prefix) + "=\"" + std::string(space.uri) + "\"";
  }
  for (const XmpProperty& property : properties)
    packet += "\n   " + property.name + "=\"" + xml_escaped(property.value) + "\"";
  packet +=
      "/>\n"
      " </rdf:RDF>\n"
      "</x:xmpmeta>\n"
      "<?xpacket end=\"r\"?>";
  return packet;
}

std::string gpano_packet(int width, int height, const XmpProperties& also) {
  return gpano_packet({width, height, 0, 0, width, height}, also);
}

std::string gpano_packet(const SphereArea& area, const XmpProperties& also) {
  const auto text = [](std::int64_t number) { return std::to_string(number); };
  XmpProperties properties{{"GPano:ProjectionType", "equirectangular"},
                           {"GPano:UsePanoramaViewer", "True"},
                           {"GPano:StitchingSoftware", "Nodal"},
                           {"GPano:CroppedAreaImageWidthPixels", text(area.width)},
                           {"GPano:CroppedAreaImageHeightPixels", text(area.height)},
                           {"GPano:FullPanoWidthPixels", text(area.full_width)},
                           {"GPano:FullPanoHeightPixels", text(area.full_height)},
                           {"GPano:CroppedAreaLeftPixels", text(area.left)},
                           {"GPano:CroppedAreaTopPixels", text(area.top)}};
  properties.insert(properties.end(), also.begin(), also.end());
  return xmp_packet(properties);
}

std::string raymap_packet(std::string_view layout, int width, int height, const XmpProperties& also) {
  return is_whole_sphere(layout) ? gpano_packet(width, height, also) : xmp_packet(also);
}

}  // namespace nodal::media
