#include "protocol/take/matroska_writer.h"

#include <zlib.h>

#include <algorithm>
#include <utility>

#include "protocol/base/result.h"
#include "protocol/take/ebml.h"

namespace nodal::take {
namespace {

// Names as in RFC 9559.
constexpr ElementId kEbml = 0x1A45DFA3, kEbmlVersion = 0x4286, kEbmlReadVersion = 0x42F7, kEbmlMaxIdLength = 0x42F2,
                    kEbmlMaxSizeLength = 0x42F3, kDocType = 0x4282, kDocTypeVersion = 0x4287,
                    kDocTypeReadVersion = 0x4285, kCrc32 = 0xBF;
constexpr ElementId kSegment = 0x18538067, kSeekHead = 0x114D9B74, kSeek = 0x4DBB, kSeekId = 0x53AB,
                    kSeekPosition = 0x53AC;
constexpr ElementId kInfo = 0x1549A966, kTimestampScale = 0x2AD7B1, kDuration = 0x4489, kMuxingApp = 0x4D80,
                    kWritingApp = 0x5741;
constexpr ElementId kTracks = 0x1654AE6B, kTrackEntry = 0xAE, kTrackNumber = 0xD7, kTrackUid = 0x73C5,
                    kTrackType = 0x83, kFlagLacing = 0x9C, kDefaultDuration = 0x23E383, kCodecId = 0x86, kVideo = 0xE0,
                    kFlagInterlaced = 0x9A, kPixelWidth = 0xB0, kPixelHeight = 0xBA, kColour = 0x55B0,
                    kMatrixCoefficients = 0x55B1, kRange = 0x55B9, kProjection = 0x7670, kProjectionType = 0x7671,
                    kProjectionPrivate = 0x7672;
constexpr ElementId kCluster = 0x1F43B675, kTimestamp = 0xE7, kSimpleBlock = 0xA3;
constexpr ElementId kCues = 0x1C53BB6B, kCuePoint = 0xBB, kCueTime = 0xB3, kCueTrackPositions = 0xB7, kCueTrack = 0xF7,
                    kCueClusterPosition = 0xF1;

constexpr std::size_t kTracksAt = MatroskaWriter::kSectorAt + MatroskaWriter::kSector;
constexpr std::uint64_t kTrack = 1;
constexpr std::uint64_t kProgressive = 2, kFullRange = 2, kVideoRange = 1, kBt601 = 5, kEquirectangular = 1;
constexpr std::uint8_t kKeyFrame = 0x80;
constexpr std::size_t kClusterHead = 12;                // its id and length
constexpr std::size_t kCheckedFrom = kClusterHead + 6;  // after the CRC

std::size_t begin_segment(Bytes& out) {
  Bytes ebml;
  put_number(ebml, kEbmlVersion, 1);
  put_number(ebml, kEbmlReadVersion, 1);
  put_number(ebml, kEbmlMaxIdLength, 4);
  put_number(ebml, kEbmlMaxSizeLength, 8);
  put_text(ebml, kDocType, "matroska");
  put_number(ebml, kDocTypeVersion, 4);
  put_number(ebml, kDocTypeReadVersion, 2);
  put_element(out, kEbml, ebml);
  put_id(out, kSegment);
  put_length(out, kUnknownLength);
  return out.size();
}

/// Positions in the file count from here.
std::size_t segment_start() {
  Bytes out;
  return begin_segment(out);
}

Bytes info_of(const VideoTrack& track, double duration_ticks) {
  Bytes info;
  put_number(info, kTimestampScale, static_cast<std::uint64_t>(MatroskaWriter::kTick.ns()));
  put_text(info, kMuxingApp, "nodal");
  put_text(info, kWritingApp, track.writer.substr(0, 128));  // the sector has room for it
  if (duration_ticks > 0) put_float(info, kDuration, duration_ticks);
  Bytes element;
  put_element(element, kInfo, info);
  return element;
}

Bytes tracks_of(const VideoTrack& track) {
  Bytes colour;
  put_number(colour, kMatrixCoefficients, kBt601);
  put_number(colour, kRange, track.full_range ? kFullRange : kVideoRange);
  Bytes video;
  put_number(video, kFlagInterlaced, kProgressive);
  put_number(video, kPixelWidth, static_cast<std::uint64_t>(track.width));
  put_number(video, kPixelHeight, static_cast<std::uint64_t>(track.height));
  put_element(video, kColour, colour);
  if (track.equirectangular) {
    Bytes projection;
    put_number(projection, kProjectionType, kEquirectangular);
    put_element(projection, kProjectionPrivate, std::array<std::uint8_t, 20>{});  // version, flags, nothing cut off
    put_element(video, kProjection, projection);
  }
  Bytes entry;
  put_number(entry, kTrackNumber, kTrack);
  put_number(entry, kTrackUid, kTrack);
  put_number(entry, kTrackType, 1);
  put_number(entry, kFlagLacing, 0);
  if (track.rate) put_number(entry, kDefaultDuration, static_cast<std::uint64_t>(track.rate->period().ns()));
  put_text(entry, kCodecId, track.codec);
  put_element(entry, kVideo, video);
  Bytes entries;
  put_element(entries, kTrackEntry, entry);
  Bytes element;
  put_element(element, kTracks, entries);
  return element;
}

void put_seek(Bytes& out, ElementId id, std::uint64_t position) {
  Bytes name, seek;
  put_id(name, id);
  put_element(seek, kSeekId, name);
  put_number(seek, kSeekPosition, position);
  put_element(out, kSeek, seek);
}

}  // namespace

MatroskaWriter::MatroskaWriter(const VideoTrack& track) : track_(track) {
  size_ = head().size();
  if (track.rate) last_ticks_ = std::max<std::int64_t>(1, track.rate->period().ns() / kTick.ns());
}

std::vector<std::uint8_t> MatroskaWriter::head() const {
  Bytes out;
  begin_segment(out);
  pad_to(out, kSectorAt);
  const Bytes info = info_of(track_, 0);
  out.insert(out.end(), info.begin(), info.end());
  pad_to(out, kTracksAt);
  const Bytes tracks = tracks_of(track_);
  out.insert(out.end(), tracks.begin(), tracks.end());
  return out;
}

std::vector<std::uint8_t> MatroskaWriter::add(Duration since_start, std::span<const std::uint8_t> frame) {
  NODAL_ASSERT(cues_at_ == 0 && frame.size() <= kLargestFrame);
  const std::int64_t ticks = since_start.ns() / kTick.ns();
  NODAL_ASSERT(ticks >= newest_ticks_);
  Bytes ready;
  const bool full =
      cluster_.size() + frame.size() > kLargestCluster || ticks - cluster_ticks_ >= kLongestCluster.ns() / kTick.ns();
  if (!cluster_.empty() && full) ready = close_cluster();
  if (cluster_.empty()) begin_cluster(ticks);
  if (ticks > newest_ticks_) last_ticks_ = ticks - newest_ticks_;
  newest_ticks_ = ticks;
  put_id(cluster_, kSimpleBlock);
  put_short_length(cluster_, frame.size() + 4);
  put_short_length(cluster_, kTrack);  // a track's number is coded as lengths are
  put_big_endian(cluster_, static_cast<std::uint64_t>(ticks - cluster_ticks_), 2);
  cluster_.push_back(kKeyFrame);
  cluster_.insert(cluster_.end(), frame.begin(), frame.end());
  return ready;
}

/// The length and the CRC are filled in by close_cluster().
void MatroskaWriter::begin_cluster(std::int64_t ticks) {
  cluster_ticks_ = ticks;
  put_id(cluster_, kCluster);
  put_length(cluster_, 0);
  put_id(cluster_, kCrc32);
  put_short_length(cluster_, 4);
  put_big_endian(cluster_, 0, 4);
  NODAL_ASSERT(cluster_.size() == kCheckedFrom);
  put_number(cluster_, kTimestamp, static_cast<std::uint64_t>(ticks));
}

std::vector<std::uint8_t> MatroskaWriter::close_cluster() {
  Bytes length;
  put_length(length, cluster_.size() - kClusterHead);
  std::ranges::copy(length, cluster_.begin() + kClusterHead - 8);
  const uLong crc = ::crc32_z(0, cluster_.data() + kCheckedFrom, cluster_.size() - kCheckedFrom);
  for (std::size_t k = 0; k < 4; ++k) {  // lowest byte first
    cluster_[kCheckedFrom - 4 + k] = static_cast<std::uint8_t>(crc >> (8 * k));
  }
  cues_.push_back({cluster_ticks_, size_ - segment_start()});
  size_ += cluster_.size();
  return std::exchange(cluster_, {});
}

std::vector<std::uint8_t> MatroskaWriter::end() {
  NODAL_ASSERT(cues_at_ == 0);
  Bytes out;
  if (!cluster_.empty()) out = close_cluster();
  Bytes cues;
  for (const Cue& cue : cues_) {
    Bytes where, point;
    put_number(where, kCueTrack, kTrack);
    put_number(where, kCueClusterPosition, cue.at);
    put_number(point, kCueTime, static_cast<std::uint64_t>(cue.ticks));
    put_element(point, kCueTrackPositions, where);
    put_element(cues, kCuePoint, point);
  }
  cues_at_ = size_ - segment_start();
  put_element(out, kCues, cues);
  return out;
}

std::array<std::uint8_t, MatroskaWriter::kSector> MatroskaWriter::sector() const {
  NODAL_ASSERT(cues_at_ != 0);
  Bytes seeks, out;
  const auto start = static_cast<std::uint64_t>(segment_start());
  put_seek(seeks, kTracks, kTracksAt - start);
  put_seek(seeks, kCues, cues_at_);
  put_element(out, kSeekHead, seeks);
  const Bytes info = info_of(track_, cues_.empty() ? 0 : static_cast<double>(newest_ticks_ + last_ticks_));
  out.insert(out.end(), info.begin(), info.end());
  pad_to(out, kSector);
  std::array<std::uint8_t, kSector> sector{};
  std::ranges::copy(out, sector.begin());
  return sector;
}

}  // namespace nodal::take
