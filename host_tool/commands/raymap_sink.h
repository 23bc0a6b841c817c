// Where a command stores the raymaps that it gets: files, a film, standard output.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "host_tool/commands/film_file.h"
#include "host_tool/commands/picture_file.h"
#include "host_tool/console/console.h"
#include "protocol/base/result.h"

namespace nodal::host {

struct RaymapSink {
  std::string pattern;  ///< "-": standard output
  RaymapFormat format = RaymapFormat::kJpg;
  std::shared_ptr<FilmFile> film{};  ///< all raymaps in one file; then `format` is kJpg

  /// A film of that name. Errors: those of FilmFile.
  static Result<RaymapSink> film_of(const std::string& name);
  /// Stores a raymap, a JPEG if `format` is kJpg, and returns the name of its file. Errors name the file.
  Result<std::string> store(const ReceivedRaymap& raymap, std::uint64_t number, Console& console) const;
};

}  // namespace nodal::host
