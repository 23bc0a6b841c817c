// Pictures of one size one after the other, each a JPEG with its time: a film in a file, or the raymaps of a take.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host::look {

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
  /// The layout that the film says it has; empty: it says none.
  const std::string& layout() const { return layout_; }
  /// The JPEG of picture `k`.
  virtual Result<std::vector<std::uint8_t>> frame(std::size_t k) = 0;

 protected:
  std::vector<std::int64_t> times_;
  std::string layout_;
};

/// Whether it is a film or the folder of a take.
bool is_film(const std::string& path);
/// Errors: also kUnsupported for pictures that are no JPEGs, kNotFound for a take without raymaps, and those of
/// media::TakeFolder.
Result<std::unique_ptr<Film>> open_film(const std::string& path);

/// A Matroska file of JPEGs, such as `nodal raymap pull` and `nodal render` write. Of a file that was cut, the pictures
/// that are whole. The file stays open, so that it may be removed.
Result<std::unique_ptr<Film>> open_matroska(const std::string& file);
/// One picture of a layout.
std::unique_ptr<Film> film_of(std::vector<std::uint8_t> jpeg, const std::string& layout);
/// The raymaps of a take on this computer; its folder must stay.
Result<std::unique_ptr<Film>> open_take_raymaps(const std::string& folder);

}  // namespace nodal::host::look
