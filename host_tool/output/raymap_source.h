// A raymap from a file, and the layout that it has.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::host {

struct RaymapInput {
  DecodedImage picture;
  bool says_equirectangular = false;  ///< by GPano metadata
};

/// `from_metadata`: a part of a sphere is placed on the sphere where the file's metadata say.
/// Errors: those of read_deep_picture() and media::whole_sphere(), which name the file.
Result<RaymapInput> read_raymap(const std::string& file, bool from_metadata);

/// What a raymap shows.
struct RaymapSource {
  std::unique_ptr<geometry::RaymapLayout> layout;
  double pixels_per_radian = 0;              ///< where its pixels are largest
  std::optional<geometry::LayoutName> name;  ///< nothing for pictures of fisheyes
};

/// `from`: the option --from, a layout or a geometry::FisheyePicture; empty: as the metadata say.
/// Errors: kMissingField if neither says it; those of layout_named() and geometry::make_layout().
Result<RaymapSource> source_of(const std::string& from, const std::string& file, const RaymapInput& input);

/// A sentence if the picture's sides do not suit a raymap of the whole sphere: a photograph, or a part of a sphere,
/// would be stretched over the whole sphere. Otherwise empty.
std::string shape_warning(const std::string& file, const RaymapSource& source, const RaymapInput& input);

}  // namespace nodal::host
