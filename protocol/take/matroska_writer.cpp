#include "protocol/take/matroska_writer.h"

#include <libdeflate.h>

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
constexpr ElementId kInfo = 0x1549A966, kTimestampScale = 0x2AD7B1, kDuration = 0x4489, kDateUtc = 0x4461,
                    kMuxingApp = 0x4D80, kWritingApp = 0x5741;
constexpr ElementId kTracks = 0x1654AE6B, kTrackEntry = 0xAE, kTrackNumber = 0xD7, kTrackUid = 0x73C5,
                    kTrackType = 0x83, kFlagLacing = 0x9C, kDefaultDuration = 0x23E383, kCodecId = 0x86,
                    kCodecPrivate = 0x63A2, kVideo = 0xE0, kFlagInterlaced = 0x9A, kFieldOrder = 0x9D,
                    kColourSpace = 0x2EB524, kPixelWidth = 0xB0, kPixelHeight = 0xBA, kColour = 0x55B0,
                    kMatrixCoefficients = 0x55B1, kRange = 0x55B9, kProjection = 0x7670, kProjectionType = 0x7671,
                    kProjectionPrivate = 0x7672;
constexpr ElementId kAttachments = 0x1941A469, kAttachedFile = 0x61A7, kFileName = 0x466E, kFileMediaType = 0x4660,
                    kFileData = 0x465C, kFileUid = 0x46AE;
constexpr ElementId kCluster = 0x1F43B675, kTimestamp = 0xE7, kSimpleBlock = 0xA3;
constexpr ElementId kCues = 0x1C53BB6B, kCuePoint = 0xBB, kCueTime = 0xB3, kCueTrackPositions = 0xB7, kCueTrack = 0xF7,
                    kCueClusterPosition = 0xF1;

constexpr std::size_t kTracksAt = MatroskaWriter::kSectorAt + MatroskaWriter::kSector;
constexpr std::uint64_t kTrack = 1;
constexpr std::uint64_t kProgressive = 2, kInterlaced = 1;
// RFC 9559, FieldOrder: of frames whose rows alternate between the fields, and of fields one after the other. FFmpeg's
// decoder of MJPEG knows that the first JPEG is the bottom field by kBottomThenTop only.
constexpr std::uint64_t kTopFirst = 9, kBottomFirst = 14, kTopThenBottom = 1, kBottomThenTop = 6;
/// 2001-01-01, from which DateUTC counts, after 1970.
constexpr std::int64_t kEpochNs = std::int64_t{978'307'200} * 1'000'000'000;
constexpr std::uint64_t kFullRange = 2, kVideoRange = 1, kBt709 = 1, kBt601 = 5, kEquirectangular = 1;
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
  if (track.utc_ns) {
    Bytes date;
    put_big_endian(date, static_cast<std::uint64_t>(*track.utc_ns - kEpochNs), 8);
    put_element(info, kDateUtc, date);
  }
  Bytes element;
  put_element(element, kInfo, info);
  return element;
}

Bytes tracks_of(const VideoTrack& track) {
  Bytes colour;
  put_number(colour, kMatrixCoefficients, track.coding.bt709 ? kBt709 : kBt601);
  put_number(colour, kRange, track.coding.video_range ? kVideoRange : kFullRange);
  Bytes video;
  if (track.fields == Fields::kProgressive) {
    put_number(video, kFlagInterlaced, kProgressive);
  } else {
    put_number(video, kFlagInterlaced, kInterlaced);
    const bool top = first_field(track.fields) == FieldParity::kTop;
    put_number(video, kFieldOrder,
               track.fields_apart ? (top ? kTopThenBottom : kBottomThenTop) : (top ? kTopFirst : kBottomFirst));
  }
  if (!track.fourcc.empty()) put_text(video, kColourSpace, track.fourcc);
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
  if (!track.codec_private.empty()) put_element(entry, kCodecPrivate, track.codec_private);
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

Bytes attachments_of(const VideoTrack& track) {
  Bytes files;
  std::uint64_t uid = 1;
  for (const Attachment& each : track.attachments) {
    Bytes file;
    put_text(file, kFileName, each.name);
    put_text(file, kFileMediaType, each.media_type);
    put_text(file, kFileData, each.bytes);
    put_number(file, kFileUid, uid++);
    put_element(files, kAttachedFile, file);
  }
  Bytes element;
  if (!files.empty()) put_element(element, kAttachments, files);
  return element;
}

std::int64_t ticks_of(Duration since_start) { return since_start.ns() / MatroskaWriter::kTick.ns(); }

std::uint32_t crc_of(std::uint32_t crc, std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return crc;  // a null pointer stands for "start again"
  return libdeflate_crc32(crc, bytes.data(), bytes.size());
}

}  // namespace

std::string_view fourcc_of(PixelFormat format) {
  // As FFmpeg knows them: libavcodec/raw.c.
  switch (format) {
    case PixelFormat::kGrey8: return "Y800";
    case PixelFormat::kI420: return "I420";
    case PixelFormat::kNv12: return "NV12";
    case PixelFormat::kYuyv: return "YUY2";
    case PixelFormat::kUyvy: return "UYVY";
    case PixelFormat::kI422: return "Y42B";
    case PixelFormat::kYuv411: return "Y411";
    case PixelFormat::kRgb24: return "RGB\x18";
    case PixelFormat::kRggb8:
      return "\xBA"
             "RG\x08";
    case PixelFormat::kGrbg8:
      return "\xBA"
             "GR\x08";
    case PixelFormat::kGbrg8:
      return "\xBA"
             "GB\x08";
    case PixelFormat::kBggr8:
      return "\xBA"
             "BG\x08";
    case PixelFormat::kMjpeg:
    case PixelFormat::kGrey16:
    case PixelFormat::kRgb48: return {};
  }
  return {};
}

bool ClusterCheck::add(std::span<const std::uint8_t> bytes) {
  while (good_ && !bytes.empty()) {
    if (left_ == 0) {
      const std::size_t part = std::min(bytes.size(), kCheckedFrom - head_.size());
      head_.insert(head_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(part));
      bytes = bytes.subspan(part);
      if (head_.size() == kCheckedFrom) good_ = begin_cluster();
      continue;
    }
    const auto part = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), left_));
    crc_ = crc_of(crc_, bytes.first(part));
    bytes = bytes.subspan(part);
    left_ -= part;
    if (left_ == 0) good_ = crc_ == expected_;
  }
  return good_;
}

bool ClusterCheck::begin_cluster() {
  std::uint64_t length = 0;
  for (std::size_t k = kClusterHead - 7; k < kClusterHead; ++k) length = length << 8 | head_[k];
  Bytes expected;
  put_id(expected, kCluster);
  put_length(expected, length);
  put_id(expected, kCrc32);
  put_short_length(expected, 4);
  if (length <= kCheckedFrom - kClusterHead || !std::ranges::equal(expected, std::span(head_).first(expected.size())))
    return false;
  expected_ = 0;
  for (std::size_t k = 0; k < 4; ++k) expected_ |= std::uint32_t{head_[kCheckedFrom - 4 + k]} << (8 * k);
  left_ = length - (kCheckedFrom - kClusterHead);
  crc_ = 0;
  head_.clear();
  return true;
}

MatroskaWriter::MatroskaWriter(const VideoTrack& track) : MatroskaWriter(track, 0) { size_ = head().size(); }

MatroskaWriter::MatroskaWriter(const VideoTrack& track, std::uint64_t head_bytes) : track_(track), size_(head_bytes) {
  if (track.rate) last_ticks_ = std::max<std::int64_t>(1, track.rate->period().ns() / kTick.ns());
}

bool MatroskaWriter::cluster_full(std::size_t bytes, Duration begin, const Block& next) {
  return bytes + next.frame.size() > kLargestCluster ||
         ticks_of(next.since_start) - ticks_of(begin) >= ticks_of(kLongestCluster);
}

std::vector<std::uint8_t> MatroskaWriter::head() const {
  Bytes out;
  begin_segment(out);
  pad_to(out, kSectorAt);
  const Bytes info = info_of(track_, 0);
  out.insert(out.end(), info.begin(), info.end());
  pad_to(out, kTracksAt);
  for (const Bytes& part : {tracks_of(track_), attachments_of(track_)}) out.insert(out.end(), part.begin(), part.end());
  return out;
}

MatroskaWriter::Cluster MatroskaWriter::cluster(std::span<const Block> blocks) {
  NODAL_ASSERT(cues_at_ == 0 && !blocks.empty());
  const std::int64_t begin = ticks_of(blocks.front().since_start);
  // The headers first, because pieces of them are handed out only when their memory no longer moves.
  headers_.clear();
  put_id(headers_, kCluster);
  put_length(headers_, 0);  // filled in below, as the CRC is
  put_id(headers_, kCrc32);
  put_short_length(headers_, 4);
  put_big_endian(headers_, 0, 4);
  NODAL_ASSERT(headers_.size() == kCheckedFrom);
  put_number(headers_, kTimestamp, static_cast<std::uint64_t>(begin));
  frames_at_.clear();  // until the cluster is complete, it holds where each frame's header ends
  std::uint64_t length = 0;
  std::int64_t before = cues_.empty() ? begin : newest_ticks_;
  NODAL_ASSERT(begin >= before);
  for (const Block& block : blocks) {
    const std::int64_t ticks = ticks_of(block.since_start);
    NODAL_ASSERT(block.frame.size() <= kLargestFrame && ticks >= before && ticks - begin <= INT16_MAX);
    if (ticks > before) last_ticks_ = ticks - before;
    before = ticks;
    put_id(headers_, kSimpleBlock);
    put_short_length(headers_, block.frame.size() + 4);
    put_short_length(headers_, kTrack);  // a track's number is coded as lengths are
    put_big_endian(headers_, static_cast<std::uint64_t>(ticks - begin), 2);
    headers_.push_back(kKeyFrame);
    frames_at_.push_back(headers_.size());
    length += block.frame.size();
  }
  length += headers_.size();

  pieces_.clear();
  std::size_t from = 0;
  std::uint64_t at = size_;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const std::size_t to = frames_at_[k];
    pieces_.push_back(std::span(headers_).subspan(from, to - from));
    pieces_.push_back(blocks[k].frame);
    at += to - from;
    frames_at_[k] = at;
    at += blocks[k].frame.size();
    from = to;
  }
  std::uint32_t crc = crc_of(0, pieces_[0].subspan(kCheckedFrom));
  for (std::size_t k = 1; k < pieces_.size(); ++k) crc = crc_of(crc, pieces_[k]);
  for (std::size_t k = 0; k < 8; ++k) {
    const std::uint64_t coded = (length - kClusterHead) | std::uint64_t{1} << 56;
    headers_[kClusterHead - 8 + k] = static_cast<std::uint8_t>(coded >> (56 - 8 * k));
  }
  for (std::size_t k = 0; k < 4; ++k) {  // lowest byte first
    headers_[kCheckedFrom - 4 + k] = static_cast<std::uint8_t>(crc >> (8 * k));
  }
  note(begin, before);
  size_ += length;
  return {pieces_, frames_at_};
}

void MatroskaWriter::note(std::int64_t begin, std::int64_t newest) {
  cues_.push_back({begin, size_ - segment_start()});
  newest_ticks_ = newest;
}

void MatroskaWriter::note_cluster(Duration begin, Duration newest, std::uint64_t end) {
  NODAL_ASSERT(cues_at_ == 0 && end > size_);
  note(ticks_of(begin), ticks_of(newest));
  size_ = end;
}

std::vector<std::uint8_t> MatroskaWriter::end() {
  NODAL_ASSERT(cues_at_ == 0);
  Bytes out, cues;
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
