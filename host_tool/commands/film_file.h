// A film of raymaps or of a head's pictures, in a file that players open.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "host_tool/commands/picture_file.h"
#include "protocol/base/result.h"
#include "protocol/take/matroska_writer.h"

namespace nodal::host {

/// Appends frames, such as JPEG raymaps, to a Matroska file as they come. A film that was not ended, because the
/// program was killed or the disk became full, plays up to its last quarter of a second.
///
/// Threading: thread-bound.
/// Ownership: owns the open file.
/// Errors: kIo with the file's name.
class FilmFile {
 public:
  /// Opens the file. A film of that name is replaced when the first raymap is added, so it is kept if none comes.
  static Result<std::unique_ptr<FilmFile>> create(const std::string& name);
  /// Ends the film, as end() does.
  ~FilmFile();
  FilmFile(const FilmFile&) = delete;
  FilmFile& operator=(const FilmFile&) = delete;

  /// The first raymap decides the film's size; kBadFormat for another one. Times are the middles of the exposures; one
  /// that does not rise counts as that of the raymap before it.
  Status add(const ReceivedRaymap& raymap);
  /// The same for any frame. `track` is that of the first one; later, only its size is compared.
  Status add(const take::VideoTrack& track, std::uint64_t now_ns, std::span<const std::uint8_t> frame);
  /// UTC minus the clock of the frames' times, ns; nothing if it is unknown. Without a call, the film's date is that of
  /// this computer when the first frame is added.
  void set_utc_offset(std::optional<std::int64_t> offset_ns);
  /// Writes the index and the duration. Nothing can be added after it.
  Status end();

 private:
  struct State;
  explicit FilmFile(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace nodal::host
