// A film of raymaps or of a head's pictures, as the bytes of a file that players open.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/take/matroska_writer.h"
#include "stitch/media/raymap/raymap.h"

namespace nodal::media {

/// Frames, such as JPEG raymaps, as a Matroska file that grows as they come. A film that was not ended, because the
/// program was killed or the disk became full, plays up to its last quarter of a second.
///
/// Threading: thread-bound.
/// Ownership: owns the frames of the cluster that is not written yet.
/// Errors: those of `write`, with the frame up to which the film plays.
class Film {
 public:
  /// Stores bytes: at the end, or at an offset of the file, B. Its errors name the file.
  using Write = std::function<Status(std::span<const std::uint8_t> bytes, std::optional<std::uint64_t> at)>;

  /// Writes nothing yet. `name`: of the film, for errors.
  Film(std::string name, Write write) : name_(std::move(name)), write_(std::move(write)) {}

  /// The first raymap decides the film's size; kBadFormat for another one. Times are the middles of the exposures; one
  /// that does not rise counts as that of the raymap before it.
  Status add(const Raymap& raymap);
  /// The same for any frame. `track` is that of the first one; later, only its size is compared.
  Status add(const take::VideoTrack& track, std::uint64_t now_ns, std::span<const std::uint8_t> frame);
  /// UTC minus the clock of the frames' times, ns; nothing if it is unknown. Without a call, the film's date is that of
  /// this computer when the first frame is added.
  void set_utc_offset(std::optional<std::int64_t> offset_ns);
  /// Writes the index and the duration. Nothing can be added after it.
  Status end();
  /// Whether a frame was added.
  bool begun() const { return writer_.has_value(); }

 private:
  struct Frame {
    Duration since_start;
    std::vector<std::uint8_t> bytes;
  };
  std::optional<std::int64_t> utc_of(std::uint64_t frame_ns) const;
  Status write_cluster();
  Status write(std::span<const std::uint8_t> bytes, std::optional<std::uint64_t> at = std::nullopt) const;

  std::string name_;
  Write write_;
  std::optional<take::MatroskaWriter> writer_;  ///< once the first frame is there
  int width_ = 0, height_ = 0;
  bool live_ = true;  ///< no offset was set
  std::optional<std::int64_t> utc_offset_ns_;
  std::uint64_t first_ns_ = 0;
  std::int64_t newest_ns_ = 0;
  std::uint64_t frames_ = 0;
  std::vector<Frame> open_;  ///< the frames of the next cluster
  std::size_t open_bytes_ = 0;
  bool ended_ = false;
};

}  // namespace nodal::media
