#include "stitch/media/raymap/kept_metadata.h"

#include <algorithm>
#include <utility>

#include "stitch/media/exif/place_and_time.h"
#include "stitch/media/xmp/xmp.h"

namespace nodal::media {

KeptMetadata kept_metadata(const FileMetadata& metadata, Keep keep) {
  KeptMetadata kept;
  for (XmpProperty& property : parse_xmp(metadata.xmp).kept) {
    if (keep != Keep::kPlaceAndTime || !property.name.starts_with("GPano:"))
      kept.properties.push_back(std::move(property));
  }
  PlaceAndTime known = place_and_time(metadata, keep == Keep::kAll);
  kept.exif = std::move(known.exif);
  for (auto& [name, value] : known.properties) {
    if (std::ranges::find(kept.properties, name, &XmpProperty::name) != kept.properties.end()) continue;
    kept.properties.push_back({name, std::move(value)});
  }
  return kept;
}

}  // namespace nodal::media
