// Video as a Matroska file (RFC 9559) that opens in players even if its end is missing.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/units.h"

namespace nodal::take {

/// A small file inside the file, such as the calibration.
struct Attachment {
  std::string name;
  std::string media_type;
  std::string bytes;
};

/// What a file says about its pictures.
struct VideoTrack {
  std::string codec = "V_MJPEG";  ///< Matroska's name: every frame can be decoded by itself
  /// V_UNCOMPRESSED only: the pixel format by its FourCC, such as "YUY2".
  std::string fourcc{};
  std::vector<std::uint8_t> codec_private{};  ///< what the codec's decoder must know before the first frame
  int width = 0;                              ///< px
  int height = 0;
  std::optional<FrameRate> rate{};  ///< nominal, if known; frames have their own times
  Fields fields = Fields::kProgressive;
  /// Interlaced frames: each field is coded by itself, the one exposed first comes first. Otherwise their rows
  /// alternate.
  bool fields_apart = false;
  /// How Y U V stand for R G B; as in JPEG if nothing else is said.
  ColourCoding coding{};
  bool equirectangular = false;  ///< a whole sphere: players with a view of it use it
  std::string writer;            ///< program and version, for people who find the file later
  /// When the first frame was exposed, ns since 1970; empty: unknown.
  std::optional<std::int64_t> utc_ns{};
  std::vector<Attachment> attachments{};
};

/// The FourCC of V_UNCOMPRESSED; empty for MJPEG, which is a codec of its own, and for 16-bit formats.
std::string_view fourcc_of(PixelFormat format);

/// One frame of a cluster.
struct Block {
  Duration since_start;  ///< time since this file's first frame, never before that of the previous frame
  std::span<const std::uint8_t> frame;
};

/// Makes the bytes of a file with one video track. They are appended only, except for one sector at the end.
///
///   bytes       content
///   0           EBML header, head of a segment of unknown size, padding
///   kSectorAt   a sector: Info; at the end it is written once more, then with the duration and a SeekHead
///   1024        Tracks, Attachments, then clusters of known size with a CRC-32; at the end Cues
///
/// So a file that was cut anywhere holds every complete cluster. Frames are not copied.
///
/// Threading: thread-bound.
/// Ownership: what it returns is valid until the next call, and as long as the frames are.
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
  /// Goes on in a file whose head() has this many bytes.
  MatroskaWriter(const VideoTrack& track, std::uint64_t head_bytes);

  /// Whether a frame belongs in the next cluster: the open one has frames of `bytes` altogether, the first at `begin`.
  static bool cluster_full(std::size_t bytes, Duration begin, const Block& next);

  /// The beginning of the file: append it first.
  std::vector<std::uint8_t> head() const;

  /// A cluster: pieces to append one after the other, and where in the file each frame will be.
  struct Cluster {
    std::span<const std::span<const std::uint8_t>> pieces;
    std::span<const std::uint64_t> frames_at;
  };
  /// At least one frame, as cluster_full() allows them; a frame has at most kLargestFrame bytes.
  Cluster cluster(std::span<const Block> blocks);
  /// Goes on in a file that has a cluster already, which an earlier writer made and which ends at `end`.
  void note_cluster(Duration begin, Duration newest, std::uint64_t end);
  /// Bytes of the file so far.
  std::uint64_t size() const { return size_; }

  /// The Cues; append them. No cluster can be added after it.
  std::vector<std::uint8_t> end();
  /// After end(): write this over the sector at kSectorAt.
  std::array<std::uint8_t, kSector> sector() const;

 private:
  void note(std::int64_t begin, std::int64_t newest);

  VideoTrack track_;
  std::uint64_t size_ = 0;
  std::int64_t newest_ticks_ = 0;
  std::int64_t last_ticks_ = 1;  ///< how long the newest frame is shown: as long as the one before it
  struct Cue {
    std::int64_t ticks = 0;
    std::uint64_t at = 0;  ///< position of the cluster, bytes from the segment's first byte
  };
  std::vector<Cue> cues_;
  std::uint64_t cues_at_ = 0;
  // Memory of the newest cluster.
  std::vector<std::uint8_t> headers_;
  std::vector<std::span<const std::uint8_t>> pieces_;
  std::vector<std::uint64_t> frames_at_;
};

/// Checks clusters that follow each other in a file and arrive in pieces of any size: each one's id, length and CRC-32.
///
/// Threading: thread-bound. Ownership, errors: none.
class ClusterCheck {
 public:
  /// False from the first byte on that shows that a cluster is not whole; what comes after is not looked at.
  bool add(std::span<const std::uint8_t> bytes);
  /// Whether all bytes so far are whole clusters.
  bool whole() const { return good_ && head_.empty() && left_ == 0; }

 private:
  bool begin_cluster();

  bool good_ = true;
  std::vector<std::uint8_t> head_;  ///< what has arrived of the current cluster's header
  std::uint64_t left_ = 0;          ///< bytes of the current cluster that have not arrived
  std::uint32_t expected_ = 0, crc_ = 0;
};

}  // namespace nodal::take
