#include "host_tool/commands/raymap_sink.h"

#include <span>
#include <utility>
#include <vector>

#include "host_tool/console/files.h"

namespace nodal::host {

Result<RaymapSink> RaymapSink::film_of(const std::string& name) {
  auto film = FilmFile::create(name);
  if (!film) return fail(film.error());
  RaymapSink sink;
  sink.film = std::move(*film);
  sink.pattern = name;
  return sink;
}

Result<std::string> RaymapSink::store(const ReceivedRaymap& raymap, std::uint64_t number, Console& console) const {
  if (film) {
    if (const Status added = film->add(raymap); !added) return fail(added.error());
    return pattern;
  }
  std::vector<std::uint8_t> file;
  std::span<const std::uint8_t> bytes = raymap.bytes;
  if (format == RaymapFormat::kPng || format == RaymapFormat::kTiff) {
    Result<std::vector<std::uint8_t>> encoded = format == RaymapFormat::kPng ? encode_png(raymap) : encode_tiff(raymap);
    if (!encoded) return fail(encoded.error());
    file = std::move(*encoded);
    bytes = file;
  }
  if (pattern == "-") {
    console.bytes({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    return std::string("-");
  }
  const Result<std::string> name = numbered_name(pattern, number);
  if (!name) return fail(name.error());
  // Not synced: a disk could not sync 30 files per second, and a new file follows soon anyway.
  if (const Status written = write_file(*name, bytes, Durability::kLater); !written) return fail(written.error());
  if (format == RaymapFormat::kRaw) {
    if (const Status written = write_file(*name + ".json", raw_sidecar(raymap)); !written) return fail(written.error());
  }
  return *name;
}

}  // namespace nodal::host
