// A film in a file that grows as frames come.
#pragma once

#include <memory>
#include <string>

#include "protocol/base/result.h"
#include "stitch/media/raymap/film.h"

namespace nodal::host {

/// Threading: thread-bound.
/// Ownership: owns the open file.
/// Errors: kIo with the file's name.
class FilmFile {
 public:
  /// Opens the file. A film of that name is replaced when the first frame is added, so it is kept if none comes.
  static Result<std::unique_ptr<FilmFile>> create(const std::string& name);
  /// Ends the film, as Film::end() does.
  ~FilmFile();
  FilmFile(const FilmFile&) = delete;
  FilmFile& operator=(const FilmFile&) = delete;

  media::Film& film() { return film_; }

 private:
  FilmFile(std::string name, int descriptor, bool created);
  Status write(std::span<const std::uint8_t> bytes, std::optional<std::uint64_t> at);

  std::string name_;
  int descriptor_;
  bool created_;          ///< there was no file of that name
  bool emptied_ = false;  ///< what was there is gone
  media::Film film_;
};

}  // namespace nodal::host
