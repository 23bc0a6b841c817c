#include "stitch/media/gpano.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "protocol/base/limits.h"

namespace nodal::media {
namespace {

/// The value of a property, as an attribute or an element; empty if there is none.
std::string_view property(std::string_view file, const std::string& name) {
  for (const auto& [begin, end] : {std::pair(name + "=\"", '"'), {"<" + name + ">", '<'}}) {
    const std::size_t at = file.find(begin);
    if (at == std::string_view::npos) continue;
    const std::string_view rest = file.substr(at + begin.size());
    return rest.substr(0, rest.find(end));
  }
  return {};
}

std::int64_t pixels(std::string_view file, const std::string& name) {
  const std::string_view text = property(file, "GPano:" + name);
  std::int64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

}  // namespace

std::optional<SphereArea> read_gpano(std::string_view file) {
  if (property(file, "GPano:ProjectionType") != "equirectangular") return std::nullopt;
  return SphereArea{pixels(file, "FullPanoWidthPixels"),         pixels(file, "FullPanoHeightPixels"),
                    pixels(file, "CroppedAreaLeftPixels"),       pixels(file, "CroppedAreaTopPixels"),
                    pixels(file, "CroppedAreaImageWidthPixels"), pixels(file, "CroppedAreaImageHeightPixels")};
}

Result<DecodedImage> whole_sphere(DecodedImage part, const SphereArea& area) {
  if (area.full_width == 0 || area.full_height == 0 || area.width == 0 || area.height == 0) return part;
  if (area.left == 0 && area.top == 0 && area.width == area.full_width && area.height == area.full_height) return part;
  const auto inside = [](std::int64_t begin, std::int64_t length, std::int64_t whole) {
    return begin >= 0 && length > 0 && whole <= std::int64_t{1} << 32 && length <= whole && begin <= whole - length;
  };
  if (!inside(area.left, area.width, area.full_width) || !inside(area.top, area.height, area.full_height)) {
    return fail(Errc::kBadFormat, "its metadata says that it shows " + std::to_string(area.width) + "x" +
                                      std::to_string(area.height) + " px from " + std::to_string(area.left) + ", " +
                                      std::to_string(area.top) + " on of a sphere of " +
                                      std::to_string(area.full_width) + "x" + std::to_string(area.full_height));
  }
  // The picture may have been resized since.
  const double across = static_cast<double>(part.width) / static_cast<double>(area.width);
  const double down = static_cast<double>(part.height) / static_cast<double>(area.height);
  const auto scaled = [](std::int64_t value, double by) -> std::int64_t {
    return std::llround(static_cast<double>(value) * by);
  };
  const std::int64_t width = std::max<std::int64_t>(part.width, scaled(area.full_width, across));
  const std::int64_t height = std::max<std::int64_t>(part.height, scaled(area.full_height, down));
  if (width > std::int64_t{1} << 30 || height > std::int64_t{1} << 30 ||
      static_cast<std::uint64_t>(width * height) > kMaxPicturePixels) {
    return fail(Errc::kTooLarge, "the sphere of which it shows a part has " + std::to_string(width) + "x" +
                                     std::to_string(height) + " pixels, over the limit of 512 * 2^20");
  }
  const std::int64_t left = std::min(scaled(area.left, across), width - part.width);
  const std::int64_t top = std::min(scaled(area.top, down), height - part.height);
  DecodedImage whole{part.format, static_cast<int>(width), static_cast<int>(height), {}};
  whole.bytes.resize(packed_size(whole.format, whole.width, whole.height));
  const auto bytes = static_cast<std::ptrdiff_t>(packed_size(part.format, 1, 1));
  for (int y = 0; y < part.height; ++y) {
    std::copy_n(part.bytes.begin() + y * part.width * bytes, part.width * bytes,
                whole.bytes.begin() + ((top + y) * width + left) * bytes);
  }
  return whole;
}

std::string gpano_packet(int width, int height) {
  const std::string w = std::to_string(width);
  const std::string h = std::to_string(height);
  return "<?xpacket begin=\"\xef\xbb\xbf\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\n"
         "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\" x:xmptk=\"Nodal\">\n"
         " <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n"
         "  <rdf:Description rdf:about=\"\" xmlns:GPano=\"http://ns.google.com/photos/1.0/panorama/\"\n"
         "   GPano:ProjectionType=\"equirectangular\"\n"
         "   GPano:UsePanoramaViewer=\"True\"\n"
         "   GPano:StitchingSoftware=\"Nodal\"\n"
         "   GPano:PoseHeadingDegrees=\"0\"\n"
         "   GPano:CroppedAreaImageWidthPixels=\"" +
         w +
         "\"\n"
         "   GPano:CroppedAreaImageHeightPixels=\"" +
         h +
         "\"\n"
         "   GPano:FullPanoWidthPixels=\"" +
         w +
         "\"\n"
         "   GPano:FullPanoHeightPixels=\"" +
         h +
         "\"\n"
         "   GPano:CroppedAreaLeftPixels=\"0\"\n"
         "   GPano:CroppedAreaTopPixels=\"0\"/>\n"
         " </rdf:RDF>\n"
         "</x:xmpmeta>\n"
         "<?xpacket end=\"r\"?>";
}

}  // namespace nodal::media
