#include "host_tool/commands/raymap_sink.h"

#include <span>
#include <utility>
#include <vector>

#include "host_tool/console/files.h"
#include "protocol/base/try.h"

namespace nodal::host {

Result<RaymapSink> RaymapSink::film_of(const std::string& name) {
  NODAL_TRY_ASSIGN(auto film, FilmFile::create(name));
  RaymapSink sink;
  sink.film = std::move(film);
  sink.pattern = name;
  return sink;
}

Result<std::string> RaymapSink::store(const ReceivedRaymap& raymap, std::uint64_t number, Console& console) const {
  if (film) {
    NODAL_TRY(film->add(raymap));
    return pattern;
  }
  std::vector<std::uint8_t> file;
  std::span<const std::uint8_t> bytes = raymap.bytes;
  if (format == RaymapFormat::kPng || format == RaymapFormat::kTiff) {
    NODAL_TRY_ASSIGN(std::vector<std::uint8_t> encoded,
                     format == RaymapFormat::kPng ? encode_png(raymap) : encode_tiff(raymap));
    file = std::move(encoded);
    bytes = file;
  }
  if (pattern == "-") {
    console.bytes({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    return std::string("-");
  }
  NODAL_TRY_ASSIGN(const std::string name, numbered_name(pattern, number));
  // Not synced: a disk could not sync 30 files per second, and a new file follows soon anyway.
  NODAL_TRY(write_file(name, bytes, Durability::kLater));
  if (format == RaymapFormat::kRaw) {
    NODAL_TRY(write_file(name + ".json", raw_sidecar(raymap)));
  }
  return name;
}

}  // namespace nodal::host
