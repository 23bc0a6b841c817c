// Where a command stores raymaps: files, a film, standard output.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "host_tool/console/console.h"
#include "host_tool/output/film_file.h"
#include "protocol/base/result.h"
#include "stitch/media/raymap/raymap_file.h"

namespace nodal::host {

/// Whether pictures can go to standard output. Errors: kBadValue.
Status check_pipe(const Console& console);

struct RaymapSink {
  std::string pattern;  ///< "-": standard output
  media::RaymapFormat format = media::RaymapFormat::kJpg;
  std::shared_ptr<FilmFile> film{};  ///< all raymaps in one file; then `format` is kJpg

  /// A film of that name. Errors: those of FilmFile.
  static Result<RaymapSink> film_of(const std::string& name);
  /// Stores a raymap, a JPEG if `format` is kJpg and else one that is not coded, and returns the name of its file.
  /// Errors name the file.
  Result<std::string> store(const media::Raymap& raymap, std::uint64_t number, Console& console) const;
};

}  // namespace nodal::host
