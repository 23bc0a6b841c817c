#include "host_tool/film/spherical_mp4.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::film {
namespace {

using Bytes = std::vector<std::uint8_t>;
using View = std::span<const std::uint8_t>;

constexpr std::size_t kBoxHeader = 8;
constexpr std::size_t kVisualEntry = 78;  // VisualSampleEntry without its header (ISO/IEC 14496-12, 12.1.3)
constexpr std::size_t kSoundEntry = 28;   // AudioSampleEntry without its header (12.2.3)
constexpr int kMaxBoxes = 10'000;         // limit of the boxes in one box
constexpr int kMaxDepth = 8;              // chunk offsets are at 4: trak, mdia, minf, stbl

constexpr std::array<std::uint8_t, 16> kV1Id{0xff, 0xcc, 0x82, 0x63, 0xf8, 0x55, 0x4a, 0x93,
                                             0x88, 0x14, 0x58, 0x7a, 0x02, 0x52, 0x1f, 0xdd};
constexpr std::string_view kV1 =
    "<?xml version=\"1.0\"?><rdf:SphericalVideo xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\" "
    "xmlns:GSpherical=\"http://ns.google.com/videos/1.0/spherical/\"><GSpherical:Spherical>true</GSpherical:Spherical>"
    "<GSpherical:Stitched>true</GSpherical:Stitched><GSpherical:StitchingSoftware>Nodal</GSpherical:StitchingSoftware>"
    "<GSpherical:ProjectionType>equirectangular</GSpherical:ProjectionType></rdf:SphericalVideo>";

std::uint64_t big_endian(View bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

void append(Bytes& to, std::uint64_t value, int bytes) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) to.push_back(static_cast<std::uint8_t>(value >> shift));
}

void append(Bytes& to, View bytes) { to.insert(to.end(), bytes.begin(), bytes.end()); }

View bytes_of(std::string_view text) { return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}; }

Bytes box(std::string_view type, View content) {
  Bytes made(kBoxHeader + content.size());
  for (std::size_t i = 0; i < 4; ++i) {
    made[i] = static_cast<std::uint8_t>(made.size() >> (24 - 8 * i));
    made[4 + i] = static_cast<std::uint8_t>(type[i]);
  }
  std::ranges::copy(content, made.begin() + kBoxHeader);
  return made;
}

struct Box {
  std::string_view type;
  View content;
};

/// The boxes that follow each other. QuickTime ends some lists with four zero bytes.
Result<std::vector<Box>> boxes_in(View bytes) {
  std::vector<Box> boxes;
  while (bytes.size() >= kBoxHeader) {
    const std::uint64_t size = big_endian(bytes.first(4));
    if (size < kBoxHeader || size > bytes.size() || boxes.size() == kMaxBoxes) {
      return fail(Errc::kBadFormat, "a box in its index has a wrong size");
    }
    boxes.push_back(
        {{reinterpret_cast<const char*>(bytes.data()) + 4, 4}, bytes.subspan(kBoxHeader, size - kBoxHeader)});
    bytes = bytes.subspan(size);
  }
  return boxes;
}

/// The box inside boxes inside boxes; nothing if one is not there.
Result<std::optional<View>> find(View bytes, std::initializer_list<std::string_view> path) {
  for (const std::string_view type : path) {
    NODAL_TRY_ASSIGN(const auto boxes, boxes_in(bytes));
    const auto found = std::ranges::find(boxes, type, &Box::type);
    if (found == boxes.end()) return std::nullopt;
    bytes = found->content;
  }
  return bytes;
}

Bytes sv3d() {
  Bytes equi(20, 0), prhd(16, 0), svhd(4, 0);
  append(svhd, bytes_of(std::string_view("Nodal\0", 6)));
  Bytes proj = box("prhd", prhd);
  append(proj, box("equi", equi));
  Bytes content = box("svhd", svhd);
  append(content, box("proj", proj));
  return box("sv3d", content);
}

/// The sample description, with st3d and sv3d in its first entry.
Result<Bytes> spherical_stsd(View stsd) {
  constexpr std::size_t kFields = 8;  // version, flags and number of entries
  if (stsd.size() < kFields) return fail(Errc::kBadFormat, "its sample description is cut");
  NODAL_TRY_ASSIGN(const auto entries, boxes_in(stsd.subspan(kFields)));
  Bytes made(stsd.begin(), stsd.begin() + kFields);
  for (const Box& entry : entries) {
    if (entry.content.size() < kVisualEntry) return fail(Errc::kBadFormat, "its sample description is cut");
    NODAL_TRY_ASSIGN(const auto boxes, boxes_in(entry.content.subspan(kVisualEntry)));
    Bytes content(entry.content.begin(), entry.content.begin() + kVisualEntry);
    for (const Box& old : boxes) {
      if (old.type != "st3d" && old.type != "sv3d") append(content, box(old.type, old.content));
    }
    append(content, box("st3d", Bytes(5, 0)));  // version, flags, and 0: monoscopic
    append(content, sv3d());
    append(made, box(entry.type, content));
  }
  return made;
}

/// Bytes of a sound's sample entry in front of its boxes. QuickTime's versions 1 and 2 have more fields.
std::size_t sound_fields(View entry) {
  constexpr std::size_t kVersion = 8;
  const std::uint64_t version = entry.size() < kSoundEntry ? 0 : big_endian(entry.subspan(kVersion, 2));
  return kSoundEntry + (version == 1 ? 16 : version == 2 ? 36 : 0);
}

/// Whether this is what an SA3D box may hold: version, type, order, two kinds of numbering, and a list of channels.
bool describes_ambisonics(View content) {
  constexpr std::size_t kFields = 12, kMaxChannels = 64;
  if (content.size() < kFields || content[0] != 0) return false;
  const std::uint64_t channels = big_endian(content.subspan(8, 4));
  return channels > 0 && channels <= kMaxChannels && content.size() == kFields + 4 * channels;
}

/// The sample description of a sound, with SA3D in its first entry.
Result<Bytes> ambisonic_stsd(View stsd, View ambisonic) {
  constexpr std::size_t kFields = 8;  // version, flags and number of entries
  if (stsd.size() < kFields) return fail(Errc::kBadFormat, "its sample description is cut");
  NODAL_TRY_ASSIGN(const auto entries, boxes_in(stsd.subspan(kFields)));
  Bytes made(stsd.begin(), stsd.begin() + kFields);
  for (const Box& entry : entries) {
    Bytes content(entry.content.begin(), entry.content.end());
    if (content.size() < sound_fields(entry.content)) return fail(Errc::kBadFormat, "its sample description is cut");
    if (&entry == &entries.front()) append(content, box("SA3D", ambisonic));
    append(made, box(entry.type, content));
  }
  return made;
}

/// Whether a track is of this kind: vide, soun.
Result<bool> is_track_of(View track, std::string_view kind) {
  NODAL_TRY_ASSIGN(const auto handler, find(track, {"mdia", "hdlr"}));
  return handler && handler->size() >= 12 && std::ranges::equal(handler->subspan(8, 4), bytes_of(kind));
}

class Rewriter {
 public:
  Rewriter(std::span<const MovedRange> moved, const Marks& marks)
      : moved_(moved), marks_(marks), video_found_(!marks.spherical), sound_found_(marks.ambisonic.empty()) {}

  /// The kind of track that boxes belong to.
  enum class Track : std::uint8_t { kOther, kSpheres, kAmbisonic };
  Result<Bytes> boxes(View bytes, Track track) {
    if (depth_ == kMaxDepth) return fail(Errc::kBadFormat, "the boxes of its index are nested too deep");
    NODAL_TRY_ASSIGN(const auto all, boxes_in(bytes));
    ++depth_;
    Bytes made;
    for (const Box& one : all) {
      NODAL_TRY_ASSIGN(const Bytes content, content_of(one, track));
      const bool wide = one.type == "stco" && wide_;
      append(made, box(wide ? "co64" : one.type, content));
      wide_ = false;
    }
    --depth_;
    return made;
  }
  /// The whole index.
  Result<Bytes> index(View bytes) {
    NODAL_TRY_ASSIGN(Bytes made, boxes(bytes, Track::kOther));
    if (!video_found_) return fail(Errc::kBadFormat, "its index has no video track");
    return made;
  }

 private:
  Result<Bytes> content_of(const Box& one, Track track) {
    constexpr std::array<std::string_view, 3> kParents{"mdia", "minf", "stbl"};
    if (one.type == "trak") return whole_track(one.content);
    if (one.type == "stco" || one.type == "co64") return offsets(one.content, one.type == "co64" ? 8 : 4);
    if (one.type == "stsd" && track == Track::kSpheres) return spherical_stsd(one.content);
    if (one.type == "stsd" && track == Track::kAmbisonic) return ambisonic_stsd(one.content, marks_.ambisonic);
    if (std::ranges::find(kParents, one.type) != kParents.end()) return boxes(one.content, track);
    return Bytes(one.content.begin(), one.content.end());
  }

  Result<Bytes> whole_track(View content) {
    NODAL_TRY_ASSIGN(const bool video, is_track_of(content, "vide"));
    NODAL_TRY_ASSIGN(const bool sound, is_track_of(content, "soun"));
    Track track = Track::kOther;
    if (video && !std::exchange(video_found_, true)) track = Track::kSpheres;
    if (sound && !std::exchange(sound_found_, true)) track = Track::kAmbisonic;
    NODAL_TRY_ASSIGN(Bytes made, boxes(content, track));
    if (track != Track::kSpheres) return made;
    Bytes v1(kV1Id.begin(), kV1Id.end());
    append(v1, bytes_of(kV1));
    append(made, box("uuid", v1));
    return made;
  }

  Result<Bytes> offsets(View content, std::size_t width) {
    constexpr std::size_t kFields = 8;  // version, flags and number of entries
    if (content.size() < kFields) return fail(Errc::kBadFormat, "its chunk offsets are cut");
    const std::uint64_t count = big_endian(content.subspan(4, 4));
    if (count > (content.size() - kFields) / width) return fail(Errc::kBadFormat, "its chunk offsets are cut");
    std::vector<std::uint64_t> values;
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t old = big_endian(content.subspan(kFields + i * width, width));
      const auto within = [&](const MovedRange& range) { return old >= range.begin && old < range.end; };
      const auto range = std::ranges::find_if(moved_, within);
      values.push_back(old + (range == moved_.end() ? 0 : static_cast<std::uint64_t>(range->by)));
      if (width == 4 && values.back() > UINT32_MAX) wide_ = true;
    }
    Bytes made(content.begin(), content.begin() + kFields);
    for (const std::uint64_t value : values) append(made, value, width == 8 || wide_ ? 8 : 4);
    return made;
  }

  std::span<const MovedRange> moved_;
  const Marks& marks_;
  int depth_ = 0;
  bool video_found_;   ///< the video track was read, or none gets marks
  bool sound_found_;   ///< the same of the sound track
  bool wide_ = false;  ///< the chunk offsets that were made last have 64 bits
};

struct Range {
  std::uint64_t begin = 0, end = 0;
  std::string type;
  std::size_t header = kBoxHeader;  ///< bytes; 16 with a length of 64 bits
};

Status read_at(std::FILE* file, std::uint64_t at, std::span<std::uint8_t> into) {
  if (::fseeko(file, static_cast<off_t>(at), SEEK_SET) == 0 &&
      std::fread(into.data(), 1, into.size(), file) == into.size()) {
    return {};
  }
  return fail(Errc::kTruncated, "it ends within a box");
}

Result<std::vector<Range>> top_boxes(std::FILE* file) {
  if (::fseeko(file, 0, SEEK_END) != 0) return fail(Errc::kIo, "its size is not known");
  const auto size = static_cast<std::uint64_t>(::ftello(file));
  std::vector<Range> ranges;
  for (std::uint64_t at = 0; at < size;) {
    std::array<std::uint8_t, 16> header{};
    const std::uint64_t left = size - at;
    if (left < kBoxHeader || ranges.size() == kMaxBoxes) return fail(Errc::kBadFormat, "it is no MP4 file");
    NODAL_TRY(read_at(file, at, std::span(header).first(std::min<std::uint64_t>(left, header.size()))));
    std::uint64_t length = big_endian(View(header).first(4));
    if (length == 0) length = left;
    const bool wide = length == 1;
    const std::size_t own = wide ? header.size() : kBoxHeader;
    if (wide) length = big_endian(View(header).subspan(kBoxHeader));
    if (length < own || length > left) return fail(Errc::kBadFormat, "a box has a wrong size");
    ranges.push_back({at, at + length, std::string(reinterpret_cast<const char*>(header.data()) + 4, 4), own});
    at += length;
  }
  return ranges;
}

tl::unexpected<Error> no_write() {
  return fail(errno == ENOSPC ? Errc::kDiskFull : Errc::kIo,
              errno == ENOSPC ? "the disk is full" : std::string(std::strerror(errno)));
}

Status write(std::FILE* to, View bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), to) == bytes.size()) return {};
  return no_write();
}

/// The contents of the file's index.
Result<Bytes> index_in(std::FILE* file, std::span<const Range> all) {
  const auto moov = std::ranges::find(all, "moov", &Range::type);
  if (moov == all.end()) return fail(Errc::kBadFormat, "it has no index (moov)");
  if (moov->end - moov->begin > kMaxMoovBytes) return fail(Errc::kTooLarge, "its index is over 256 MiB");
  Bytes content(moov->end - moov->begin - moov->header);
  NODAL_TRY(read_at(file, moov->begin + moov->header, content));
  return content;
}

/// What an index says of its first sound track.
Result<Bytes> ambisonic_in(View index) {
  NODAL_TRY_ASSIGN(const auto tracks, boxes_in(index));
  for (const Box& track : tracks) {
    if (track.type != "trak") continue;
    NODAL_TRY_ASSIGN(const bool sound, is_track_of(track.content, "soun"));
    if (!sound) continue;
    NODAL_TRY_ASSIGN(const auto stsd, find(track.content, {"mdia", "minf", "stbl", "stsd"}));
    if (!stsd || stsd->size() < kBoxHeader) return Bytes();
    NODAL_TRY_ASSIGN(const auto entries, boxes_in(stsd->subspan(kBoxHeader)));
    if (entries.empty()) return Bytes();
    const View entry = entries.front().content;
    if (entry.size() < sound_fields(entry)) return Bytes();
    NODAL_TRY_ASSIGN(const auto found, find(entry.subspan(sound_fields(entry)), {"SA3D"}));
    return found && describes_ambisonics(*found) ? Bytes(found->begin(), found->end()) : Bytes();
  }
  return Bytes();
}

Status copy(std::FILE* from, const Range& range, std::FILE* to) {
  Bytes piece(std::size_t{1} << 20);
  for (std::uint64_t at = range.begin; at < range.end;) {
    const std::span<std::uint8_t> now =
        std::span<std::uint8_t>(piece).first(std::min<std::uint64_t>(piece.size(), range.end - at));
    NODAL_TRY(read_at(from, at, now));
    NODAL_TRY(write(to, now));
    at += now.size();
  }
  return {};
}

}  // namespace

Result<Bytes> marked_moov(View moov, std::span<const MovedRange> moved, const Marks& marks) {
  return Rewriter(moved, marks).index(moov);
}

Bytes ambisonic_of(const std::string& file) {
  const auto in = open_to_read(file);
  if (!in) return {};
  const auto all = top_boxes(in->get());
  if (!all) return {};
  const Result<Bytes> index = index_in(in->get(), *all);
  const Result<Bytes> found = index ? ambisonic_in(*index) : Bytes();
  return found ? *found : Bytes();
}

Status write_marked_mp4(const std::string& from, const std::string& to, const Marks& marks) {
  const auto in = open_to_read(from);
  if (!in) return fail(in.error().in(from));
  const auto all = top_boxes(in->get());
  if (!all) return fail(all.error().in(from));
  const auto index = index_in(in->get(), *all);
  if (!index) return fail(index.error().in(from));
  const Bytes& content = *index;
  // The file type stays in front; the index follows; the rest keeps its order.
  const auto front = [](const Range& range) { return range.type == "ftyp"; };
  std::vector<Range> rest;
  std::ranges::copy_if(*all, std::back_inserter(rest),
                       [&](const Range& range) { return range.type != "moov" && !front(range); });
  const auto type = std::ranges::find_if(*all, front);
  const std::uint64_t before = type == all->end() ? 0 : type->end - type->begin;
  Bytes made = content;
  std::vector<MovedRange> moved;
  // The index's size decides the offsets, and offsets of 64 bits its size. A larger index makes no offset smaller, so
  // the sizes rise or fall until they settle: after one round for each track at most.
  for (std::size_t size = made.size() + 1; size != made.size();) {
    size = made.size();
    moved.clear();
    std::uint64_t at = before + kBoxHeader + size;
    for (const Range& range : rest) {
      moved.push_back({range.begin, range.end, static_cast<std::int64_t>(at) - static_cast<std::int64_t>(range.begin)});
      at += range.end - range.begin;
    }
    auto rewritten = Rewriter(moved, marks).index(content);
    if (!rewritten) return fail(rewritten.error().in(from));
    made = std::move(*rewritten);
  }
  const auto out = create_to_write(to);
  if (!out) return fail(out.error().in(to));
  Status written;
  if (type != all->end()) written = copy(in->get(), *type, out->get());
  if (written) written = write(out->get(), box("moov", made));
  for (const Range& range : rest) {
    if (written) written = copy(in->get(), range, out->get());
  }
  if (written && std::fflush(out->get()) != 0) written = no_write();
  if (!written) return fail(written.error().in(to));
  return {};
}

}  // namespace nodal::film
