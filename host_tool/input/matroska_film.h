// Pictures of one size one after the other, each a JPEG with its time: a film in a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

/// Threading: thread-bound, but to no certain thread.
/// Ownership: keeps the file, or the take's folder, open.
/// Errors: each names the file.
class Film {
 public:
  Film() = default;
  virtual ~Film() = default;
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;

  /// ns since the first picture, never falling; as many as there are pictures, at least one.
  const std::vector<std::int64_t>& times() const { return times_; }
  /// Time of the first picture, ns: by the same clock for all films that `nodal take export` makes of one take; of
  /// other programs' films, since the film began.
  std::int64_t begin_ns() const { return begin_ns_; }
  /// The layout that the film says it has; empty: it says none.
  const std::string& layout() const { return layout_; }
  /// The JPEG of picture `k`.
  virtual Result<std::vector<std::uint8_t>> frame(std::size_t k) = 0;

 protected:
  std::vector<std::int64_t> times_;
  std::int64_t begin_ns_ = 0;
  std::string layout_;
};

/// Whether the file begins as Matroska files do.
bool is_matroska(const std::string& path);

/// A Matroska file of JPEGs, such as `nodal raymap pull` and `nodal render` write. Of a file that was cut, the pictures
/// that are whole. The file stays open, so that it may be removed.
Result<std::unique_ptr<Film>> open_matroska(const std::string& file);

}  // namespace nodal::host
