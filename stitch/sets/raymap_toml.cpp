#include "stitch/sets/raymap_toml.h"

#include <fmt/format.h>

#include <string>

#include "stitch/geometry/raymap/registry.h"

namespace nodal::sets {
namespace {

/// A key that has no effect on the kind of transition is refused.
void read_transition(TomlReader& reader, RaymapConfig& raymap) {
  raymap.transition = reader.choice<Transition>(
      "transition",
      {{"two-band", Transition::kTwoBand}, {"seam", Transition::kSeam}, {"feather", Transition::kFeather}});
  if (raymap.transition == Transition::kSeam && reader.has("feather")) {
    reader.refuse("feather",
                  "has no effect with transition = \"seam\"; remove it, or write \"two-band\" or \"feather\"");
  }
  if (raymap.transition == Transition::kFeather && reader.has("seam_width")) {
    reader.refuse("seam_width",
                  "has no effect with transition = \"feather\"; remove it, or write \"two-band\" or \"seam\"");
  }
  raymap.seams =
      reader.choice<SeamPlacement>("seams", {{"fixed", SeamPlacement::kFixed}, {"placed", SeamPlacement::kPlaced}});
  if (raymap.transition == Transition::kFeather && raymap.seams == SeamPlacement::kPlaced) {
    reader.refuse("seams", "is \"placed\", but transition = \"feather\" has no seams; write \"two-band\" or \"seam\"");
  }
  raymap.seam_width_deg = reader.number("seam_width", 0, 180, raymap.seam_width_deg);
  raymap.feather = reader.number("feather", 0.01, 1, raymap.feather);
}

}  // namespace

TomlReader raymap_reader(const toml::table& raymap, FirstError& error) {
  return {raymap,
          "raymap",
          {"layout", "width", "height", "format", "jpeg_quality", "transition", "seam_width", "seams", "feather",
           "tone", "fields"},
          error};
}

RaymapConfig read_raymap(TomlReader& reader, const ReadRayFile& read) {
  RaymapConfig raymap;
  const auto beside = [&](const std::string& name) -> Result<std::string> {
    if (name.empty() || name.size() > 255 || name.find('/') != std::string::npos)
      return fail(Errc::kBadValue, "the file of a list of rays is beside rig.toml: give its name without a folder");
    if (!read) return fail(Errc::kUnsupported, "lists of rays are not read here");
    return read(name);
  };
  const auto layout = geometry::LayoutName::parse(reader.text("layout", raymap.layout), beside);
  if (!layout) {
    reader.refuse("layout", "cannot be used: " + layout.error().message, layout.error().code);
    return raymap;
  }
  raymap.layout = layout->text();
  const int usual = layout->size_for_width(layout->kind().name == "cube" ? 1536 : 2048).width;
  raymap.width = static_cast<int>(reader.integer("width", 16, 16384, usual));
  const int height = layout->size_for_width(raymap.width).height;
  raymap.height = static_cast<int>(reader.integer("height", 16, 16384, height));
  if (const Status shaped = layout->check_size({raymap.width, raymap.height}); !shaped) {
    reader.refuse("height",
                  fmt::format("is {}: {}x{} {}", raymap.height, raymap.width, raymap.height, shaped.error().message));
  }
  raymap.format = reader.choice<PixelFormat>("format", {{"I420", PixelFormat::kI420},
                                                        {"NV12", PixelFormat::kNv12},
                                                        {"RGB24", PixelFormat::kRgb24},
                                                        {"GREY", PixelFormat::kGrey8},
                                                        {"RGB48", PixelFormat::kRgb48},
                                                        {"GREY16", PixelFormat::kGrey16}});
  raymap.jpeg_quality = static_cast<int>(reader.integer("jpeg_quality", 1, 100, 85));
  read_transition(reader, raymap);
  raymap.soft = reader.choice<bool>("tone", {{"soft", true}, {"clip", false}});
  raymap.fields = reader.choice<FieldUse>("fields", {{"weave", FieldUse::kWeave}, {"separate", FieldUse::kSeparate}});
  return raymap;
}

Result<RaymapConfig> raymap_config_of(std::string_view rig_toml, const std::string& file, const ReadRayFile& read) {
  FirstError error(file);
  const toml::parse_result parsed = toml::parse(rig_toml);
  if (!parsed) {
    error.set(Errc::kBadFormat, parsed.error().source(), "not TOML: " + std::string(parsed.error().description()));
    return fail(error.get());
  }
  static const toml::table kEmpty;
  const toml::table* raymap = parsed.table()["raymap"].as_table();
  TomlReader reader = raymap_reader(raymap ? *raymap : kEmpty, error);
  RaymapConfig config = read_raymap(reader, read);
  if (error.any()) return fail(error.get());
  return config;
}

}  // namespace nodal::sets
