// The programs that read and write films: ffmpeg and ffprobe. They are started, never linked.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::film {

struct Programs {
  std::string ffmpeg;   ///< path
  std::string ffprobe;  ///< path
  std::string version;  ///< "5.1.9-0+deb12u1"
  std::set<std::string, std::less<>> encoders;
};

/// Finds both and asks for version and encoders.
/// Errors: kNotFound, with the Debian package; kVersionMismatch for one older than 5.1; kDeviceFailed.
Result<Programs> find_programs();

/// "ffmpeg version 5.1.9-0+deb12u1 Copyright ..." -> 5.1.9-0+deb12u1. Errors: kBadFormat; kVersionMismatch if it is
/// older than 5.1. A version without a number, as of a build from git, is taken for new.
Result<std::string> version_of(std::string_view answer);

/// A file's name as ffmpeg's file protocol reads it, whatever the name begins with or contains.
std::string file_url(const std::string& path);

/// Options before every `-i` of this file: only local files, only containers (never playlists or scripts that name
/// other files, but for the lists of film_list.h).
std::vector<std::string> input_rules(const std::string& path);

}  // namespace nodal::film
