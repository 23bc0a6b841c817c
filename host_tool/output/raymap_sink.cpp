#include "host_tool/output/raymap_sink.h"

#include <span>
#include <utility>
#include <vector>

#include "host_tool/console/files.h"
#include "protocol/base/try.h"

namespace nodal::host {

using media::RaymapFormat;

Status check_pipe(const Console& console) {
  if (console.json()) return fail(Errc::kBadValue, "--out - and --json both want standard output");
  if (!console.out_is_terminal()) return {};
  return fail(Errc::kBadValue, "--out - would write pictures on the terminal; send it on: | ffplay -f mjpeg -");
}

Result<RaymapSink> RaymapSink::film_of(const std::string& name) {
  NODAL_TRY_ASSIGN(auto film, FilmFile::create(name));
  RaymapSink sink;
  sink.film = std::move(film);
  sink.pattern = name;
  return sink;
}

Result<std::string> RaymapSink::store(const media::Raymap& raymap, std::uint64_t number, Console& console) const {
  if (film) {
    NODAL_TRY(film->film().add(raymap));
    return pattern;
  }
  std::vector<std::uint8_t> file;
  std::span<const std::uint8_t> bytes = raymap.bytes;
  if (format == RaymapFormat::kPng || format == RaymapFormat::kTiff) {
    NODAL_TRY_ASSIGN(file, media::encode(raymap, format));
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
    NODAL_TRY(write_file(name + ".json", media::raw_sidecar(raymap)));
  }
  return name;
}

}  // namespace nodal::host
