// Video as a Matroska file (RFC 9559) that opens in players even if its end is missing.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/units.h"

namespace nodal::take {

/// What a file says about its pictures.
struct VideoTrack {
  std::string codec = "V_MJPEG";  ///< Matroska's name: every frame can be decoded by itself
  int width = 0;                  ///< px
  int height = 0;
  std::optional<FrameRate> rate{};  ///< nominal, if known; frames have their own times
  /// Values 0 to 255 by BT.601, as in JPEG.
  bool full_range = true;
  bool equirectangular = false;  ///< a whole sphere: players with a view of it use it
  std::string writer;            ///< program and version, for people who find the file later
};

/// Makes the bytes of a file with one video track. They are appended only, except for one sector at the end.
///
///   bytes       content
///   0           EBML header, head of a segment of unknown size, padding
///   kSectorAt   a sector: Info; at the end it is written once more, then with the duration and a SeekHead
///   1024        Tracks, then clusters of known size with a CRC-32; at the end Cues
///
/// So a file that was cut anywhere holds every complete cluster, which is at most kLongestCluster of video or, where frames are
/// large, kLargestCluster bytes and one frame.
///
/// Threading: thread-bound.
/// Ownership: copies what it is given.
/// Errors: none; times and sizes are the caller's contract.
class MatroskaWriter {
 public:
  static constexpr Duration kLongestCluster = Duration::milliseconds(250);
  static constexpr std::size_t kLargestCluster = std::size_t{4} << 20;
  static constexpr std::size_t kLargestFrame = std::size_t{1} << 30;
  static constexpr std::uint64_t kSectorAt = 512;
  static constexpr std::size_t kSector = 512;
  /// Times are stored in multiples of it: the widest in which a cluster's times fit 16 bits with room to spare.
  static constexpr Duration kTick = Duration::microseconds(10);

  explicit MatroskaWriter(const VideoTrack& track);

  /// The beginning of the file: append it first.
  std::vector<std::uint8_t> head() const;
  /// Adds a frame. Returns what to append now: usually nothing, else the cluster before it. `since_start`: of this file's
  /// first frame, not before the previous frame's; the frame has at most kLargestFrame bytes.
  std::vector<std::uint8_t> add(Duration since_start, std::span<const std::uint8_t> frame);
  /// The last cluster and the Cues; append them. No frame can be added after it.
  std::vector<std::uint8_t> end();
  /// After end(): write this over the sector at kSectorAt.
  std::array<std::uint8_t, kSector> sector() const;

 private:
  void begin_cluster(std::int64_t ticks);
  std::vector<std::uint8_t> close_cluster();

  VideoTrack track_;
  std::uint64_t size_ = 0;             ///< of what was returned to append
  std::vector<std::uint8_t> cluster_;  ///< the open cluster; empty: none
  std::int64_t cluster_ticks_ = 0;     ///< time of the open cluster
  std::int64_t newest_ticks_ = 0;
  std::int64_t last_ticks_ = 1;  ///< how long the newest frame is shown: as the one before it
  struct Cue {
    std::int64_t ticks = 0;
    std::uint64_t at = 0;  ///< of the cluster, from the segment's first byte
  };
  std::vector<Cue> cues_;
  std::uint64_t cues_at_ = 0;
};

}  // namespace nodal::take
