#include "host_tool/output/raymap_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "host_tool/input/pictures.h"
#include "host_tool/output/layout_name.h"
#include "protocol/base/try.h"
#include "stitch/geometry/raymap/fisheye_picture.h"
#include "stitch/media/gpano.h"
#include "stitch/media/xmp/xmp.h"

namespace nodal::host {
namespace {

Result<geometry::LayoutName> name_of(const std::string& from, const std::string& file, const RaymapInput& input) {
  if (!from.empty()) {
    const Result<geometry::LayoutName> name = layout_named(from);
    if (!name) return fail(name.error().in("--from"));
    return *name;
  }
  if (input.says_equirectangular) return geometry::LayoutName::parse("equirectangular");
  return fail(
      Errc::kMissingField,
      fmt::format("{}: the file does not say that it is a sphere. Photographs become a sphere by `nodal stitch`; if "
                  "it is a sphere, say its layout: --from equirectangular, or one of {}",
                  file, geometry::layout_list()));
}

}  // namespace

Result<RaymapInput> read_raymap(const std::string& file, bool from_metadata) {
  NODAL_TRY_ASSIGN(DecodedImage picture, read_deep_picture(file));
  const std::optional<media::SphereArea> area = media::parse_xmp(picture.metadata.xmp).area;
  if (!area || !from_metadata) return RaymapInput{std::move(picture), area.has_value()};
  Result<DecodedImage> whole = media::whole_sphere(std::move(picture), *area);
  if (!whole) return fail(whole.error().in(file));
  return RaymapInput{std::move(*whole), true};
}

Result<RaymapSource> source_of(const std::string& from, const std::string& file, const RaymapInput& input) {
  const geometry::RaymapSize size{input.picture.width, input.picture.height};
  if (const auto lens = geometry::FisheyePicture::parse(from)) {
    if (!*lens) return fail(lens->error().in("--from"));
    return RaymapSource{(*lens)->layout(size), (*lens)->pixels_per_radian(size), std::nullopt};
  }
  NODAL_TRY_ASSIGN(const geometry::LayoutName name, name_of(from, file, input));
  auto layout = geometry::make_layout(name, size.width, size.height);
  if (!layout) return fail(layout.error().in(file));
  return RaymapSource{std::move(*layout), size.width / name.width_for_resolution(1), name};
}

std::string shape_warning(const std::string& file, const RaymapSource& source, const RaymapInput& input) {
  constexpr double kMax = 1.25;
  if (!source.name || source.layout->scattered()) return "";
  const int width = input.picture.width, height = input.picture.height;
  const geometry::RaymapSize whole = source.name->size_for_width(width);
  const double stretch = static_cast<double>(whole.height) * width / whole.width / height;
  if (stretch < kMax && stretch > 1 / kMax) return "";
  return fmt::format(
      "{}: it has {}x{} pixels, and the whole sphere ({}) with this width has {}x{}: "
      "what it shows is stretched {:.1f} times",
      file, width, height, source.name->text(), whole.width, whole.height, std::max(stretch, 1 / stretch));
}

}  // namespace nodal::host
