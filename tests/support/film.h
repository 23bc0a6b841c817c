// Films of a test, as files.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "stitch/media/raymap/film.h"

namespace nodal::test {

struct TimedPicture {
  std::uint64_t at_ns = 0;
  std::vector<std::uint8_t> jpeg;
};

/// A Matroska file; empty when a picture does not fit the track.
/// `of_take`: with the date of its first picture by the pictures' clock, as films of takes have it.
inline std::vector<std::uint8_t> film_of(const take::VideoTrack& track, const std::vector<TimedPicture>& pictures,
                                         bool of_take = false) {
  std::vector<std::uint8_t> file;
  media::Film film("film", [&](std::span<const std::uint8_t> bytes, std::optional<std::uint64_t> at) -> Status {
    const std::size_t begin = at ? static_cast<std::size_t>(*at) : file.size();
    file.resize(std::max(file.size(), begin + bytes.size()));
    std::ranges::copy(bytes, file.begin() + static_cast<std::ptrdiff_t>(begin));
    return {};
  });
  if (of_take) film.set_utc_offset(0);
  for (const TimedPicture& picture : pictures) {
    if (!film.add(track, picture.at_ns, picture.jpeg)) return {};
  }
  return film.end() ? file : std::vector<std::uint8_t>();
}

}  // namespace nodal::test
