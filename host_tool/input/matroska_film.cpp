#include "host_tool/input/matroska_film.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>

#include "hal/linux/link/descriptor_link.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::host {
namespace {

// Elements' ids (RFC 9559).
constexpr std::uint32_t kEbml = 0x1A45DFA3, kSegment = 0x18538067, kInfo = 0x1549A966, kTimestampScale = 0x2AD7B1,
                        kDateUtc = 0x4461, kWritingApp = 0x5741, kTracks = 0x1654AE6B, kTrackEntry = 0xAE,
                        kTrackNumber = 0xD7, kTrackType = 0x83, kCodecId = 0x86, kEncodings = 0x6D80, kVideo = 0xE0,
                        kProjection = 0x7670, kProjectionType = 0x7671, kCluster = 0x1F43B675, kTimestamp = 0xE7,
                        kSimpleBlock = 0xA3, kBlockGroup = 0xA0, kBlock = 0xA1;
constexpr std::uint64_t kVideoType = 1, kEquirectangular = 1;
constexpr std::uint64_t kLargestHeader = 1 << 20;                 // bytes of Info and Tracks
constexpr std::uint64_t kLargestFrame = std::uint64_t{64} << 20;  // bytes
constexpr std::size_t kLongest = 2'000'000;                       // pictures: 18 hours at 30 a second
constexpr std::uint64_t kLongestUnit = 1'000'000'000;             // ns; of times in the file
constexpr std::uint64_t kLongestTime = std::uint64_t{1} << 52;    // ns; beyond it, times are nonsense

constexpr std::int64_t kLatestDate = std::int64_t{1} << 61;  // ns since 2001: 73 years

struct Element {
  std::uint32_t id = 0;
  std::uint64_t content = 0, size = 0;  // position and length, bytes
  bool unknown_size = false;
};

/// A number as EBML codes it (RFC 8794, 4), whose first byte says how long it is.
struct Coded {
  std::uint64_t value = 0;
  std::size_t bytes = 0;
  bool all_ones = false;
};
std::optional<Coded> coded_at(std::span<const std::uint8_t> bytes, bool with_marker) {
  if (bytes.empty()) return std::nullopt;
  Coded coded;
  for (coded.bytes = 1; coded.bytes <= 8 && (bytes[0] & (0x100U >> coded.bytes)) == 0;) ++coded.bytes;
  if (coded.bytes > 8 || coded.bytes > bytes.size()) return std::nullopt;
  for (std::size_t k = 0; k < coded.bytes; ++k) coded.value = coded.value << 8 | bytes[k];
  const std::uint64_t marker = std::uint64_t{1} << (7 * coded.bytes);
  coded.all_ones = coded.value - marker == marker - 1;
  if (!with_marker) coded.value -= marker;
  return coded;
}

std::optional<Element> element_in(std::span<const std::uint8_t> bytes, std::uint64_t at) {
  const std::optional<Coded> id = coded_at(bytes, true);
  if (!id || id->bytes > 4) return std::nullopt;
  const std::optional<Coded> size = coded_at(bytes.subspan(id->bytes), false);
  if (!size) return std::nullopt;
  return Element{static_cast<std::uint32_t>(id->value), at + id->bytes + size->bytes, size->value, size->all_ones};
}

std::uint64_t number_in(std::span<const std::uint8_t> bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes.first(std::min<std::size_t>(8, bytes.size()))) value = value << 8 | byte;
  return value;
}

/// Calls `visit(id, content)` for each element that is whole.
template <class Visit>
void for_each_element(std::span<const std::uint8_t> bytes, const Visit& visit) {
  for (std::uint64_t at = 0; at < bytes.size();) {
    const std::optional<Element> element = element_in(bytes.subspan(at), at);
    if (!element || element->unknown_size || element->size > bytes.size() - element->content) return;
    visit(element->id, bytes.subspan(element->content, element->size));
    at = element->content + element->size;
  }
}

struct Track {
  std::uint64_t number = 0, type = 0;
  std::string codec;
  bool encoded = false, equirectangular = false;
};
Track track_in(std::span<const std::uint8_t> entry) {
  Track track;
  for_each_element(entry, [&](std::uint32_t id, std::span<const std::uint8_t> content) {
    if (id == kTrackNumber) track.number = number_in(content);
    if (id == kTrackType) track.type = number_in(content);
    if (id == kCodecId) track.codec.assign(content.begin(), std::ranges::find(content, std::uint8_t{0}));
    if (id == kEncodings) track.encoded = true;
    if (id != kVideo) return;
    for_each_element(content, [&](std::uint32_t part, std::span<const std::uint8_t> of) {
      if (part != kProjection) return;
      for_each_element(of, [&](std::uint32_t what, std::span<const std::uint8_t> value) {
        if (what == kProjectionType) track.equirectangular = number_in(value) == kEquirectangular;
      });
    });
  });
  return track;
}

class MatroskaFilm final : public Film {
 public:
  MatroskaFilm(std::string file, hal::Descriptor descriptor, std::uint64_t bytes)
      : file_(std::move(file)), descriptor_(std::move(descriptor)), bytes_(bytes) {}

  /// Finds all frames, without reading them.
  Status index() {
    for (std::uint64_t at = 0; at < bytes_;) {
      NODAL_TRY_ASSIGN(const std::optional<Element> element, element_at(at));
      if (!element) break;  // the file was cut here
      const bool enters = element->id == kSegment || element->id == kCluster || element->id == kBlockGroup;
      if (at == 0 && element->id != kEbml) return broken("is no Matroska file");
      if (!enters && (element->unknown_size || element->size > bytes_ - element->content)) break;
      NODAL_TRY(take(*element));
      at = enters ? element->content : element->content + element->size;
    }
    if (!track_) return broken("has no video track");
    if (frames_.empty()) return broken("has no picture");
    return {};
  }

  Result<std::vector<std::uint8_t>> frame(std::size_t k) override { return read(frames_[k].at, frames_[k].bytes); }

 private:
  struct Frame {
    std::uint64_t at = 0, bytes = 0;
  };

  tl::unexpected<Error> broken(const std::string& what) const { return fail(Errc::kBadFormat, file_ + ": " + what); }

  Result<std::vector<std::uint8_t>> read(std::uint64_t at, std::uint64_t size) const {
    std::vector<std::uint8_t> bytes(size);
    for (std::size_t got = 0; got < size;) {
      const ssize_t more = ::pread(descriptor_.get(), bytes.data() + got, size - got, static_cast<off_t>(at + got));
      if (more < 0 && errno == EINTR) continue;
      if (more < 0) return fail(Errc::kIo, fmt::format("{}: {}", file_, std::strerror(errno)));
      if (more == 0) return fail(Errc::kTruncated, file_ + ": became shorter while it was read");
      got += static_cast<std::size_t>(more);
    }
    return bytes;
  }
  Result<std::optional<Element>> element_at(std::uint64_t at) const {
    constexpr std::uint64_t kHead = 12;
    NODAL_TRY_ASSIGN(const std::vector<std::uint8_t> head, read(at, std::min(kHead, bytes_ - at)));
    return element_in(head, at);
  }

  Status take(const Element& element) {
    switch (element.id) {
      case kInfo:
      case kTracks: {
        if (element.size > kLargestHeader) return broken("its description is too long");
        NODAL_TRY_ASSIGN(const std::vector<std::uint8_t> content, read(element.content, element.size));
        return element.id == kInfo ? take_info(content) : take_tracks(content);
      }
      case kTimestamp: {
        NODAL_TRY_ASSIGN(const std::vector<std::uint8_t> content,
                         read(element.content, std::min<std::uint64_t>(8, element.size)));
        cluster_ = number_in(content);
        return {};
      }
      case kSimpleBlock:
      case kBlock: return take_block(element);
      default: return {};
    }
  }
  Status take_info(std::span<const std::uint8_t> content) {
    std::int64_t date_ns = 0;  // since 2001
    bool ours = false;
    for_each_element(content, [&](std::uint32_t id, std::span<const std::uint8_t> value) {
      if (id == kTimestampScale) scale_ns_ = number_in(value);
      if (id == kDateUtc) date_ns = static_cast<std::int64_t>(number_in(value));
      if (id == kWritingApp)
        ours = std::string_view(reinterpret_cast<const char*>(value.data()), value.size()).starts_with("nodal");
    });
    // Other programs write the whole second at which a file was made, or the date of a file that they converted.
    if (ours && date_ns > -kLatestDate && date_ns < kLatestDate) date_ns_ = date_ns;
    if (scale_ns_ > kLongestUnit) return broken("has times in units of more than a second");
    return {};
  }
  Status take_tracks(std::span<const std::uint8_t> content) {
    for_each_element(content, [&](std::uint32_t id, std::span<const std::uint8_t> entry) {
      if (id != kTrackEntry || track_) return;
      if (Track track = track_in(entry); track.type == kVideoType) track_ = std::move(track);
    });
    if (!track_) return broken("has no video track");
    if (track_->codec != "V_MJPEG" || track_->encoded) {
      return fail(
          Errc::kUnsupported,
          fmt::format("{}: its pictures are coded as {}, and only JPEGs are read; if it was exported from a take, give "
                      "the folder of the take instead; else convert it: ffmpeg -i {} "
                      "-c:v mjpeg -q:v 2 -pix_fmt yuvj420p jpegs.mkv",
                      file_, track_->codec, file_));
    }
    if (track_->equirectangular) layout_ = "equirectangular";
    return {};
  }
  Status take_block(const Element& element) {
    constexpr std::uint64_t kLongestHead = 8 + 2 + 1;
    if (!track_) return broken("has pictures before it says which track they are of");
    NODAL_TRY_ASSIGN(const std::vector<std::uint8_t> head, read(element.content, std::min(kLongestHead, element.size)));
    const std::optional<Coded> number = coded_at(head, false);
    if (!number || head.size() < number->bytes + 3) return broken("has a block that is too short");
    if (number->value != track_->number) return {};
    const std::size_t bytes = number->bytes + 3;
    if ((head[number->bytes + 2] & 0x06U) != 0) return broken("has several pictures in a block, which is not read");
    if (element.size - bytes > kLargestFrame) return broken("has a picture that is too large");
    if (frames_.size() == kLongest) return fail(Errc::kTooLarge, file_ + ": has more than 2000000 pictures");
    const auto after = static_cast<std::int16_t>(head[number->bytes] << 8 | head[number->bytes + 1]);
    const std::uint64_t most = kLongestTime / std::max<std::uint64_t>(1, scale_ns_);
    if (cluster_ > most) return broken("has a time beyond all films");
    const std::int64_t now = (static_cast<std::int64_t>(cluster_) + after) * static_cast<std::int64_t>(scale_ns_);
    if (frames_.empty()) begin_ns_ = date_ns_ + now;
    times_.push_back(std::max(times_.empty() ? 0 : times_.back(), date_ns_ + now - begin_ns_));
    frames_.push_back({element.content + bytes, element.size - bytes});
    return {};
  }

  std::string file_;
  hal::Descriptor descriptor_;
  std::uint64_t bytes_;
  std::uint64_t scale_ns_ = 1'000'000;  // RFC 9559: when the file does not say
  std::uint64_t cluster_ = 0;           // time of the cluster that is read, in units of the scale
  std::int64_t date_ns_ = 0;            // when time 0 was, if this program wrote the film
  std::optional<Track> track_;
  std::vector<Frame> frames_;
};

}  // namespace

Result<std::unique_ptr<Film>> open_matroska(const std::string& file) {
  const Result<int> opened = open_descriptor_to_read(file);
  if (!opened) return fail(opened.error().in(file));
  hal::Descriptor descriptor(*opened);
  struct stat about {};
  if (::fstat(descriptor.get(), &about) != 0) return fail(Errc::kIo, fmt::format("{}: {}", file, std::strerror(errno)));
  auto film = std::make_unique<MatroskaFilm>(file, std::move(descriptor), static_cast<std::uint64_t>(about.st_size));
  NODAL_TRY(film->index());
  return film;
}

bool is_matroska(const std::string& path) {
  const Result<int> opened = open_descriptor_to_read(path);
  if (!opened) return false;
  const hal::Descriptor descriptor(*opened);
  std::array<std::uint8_t, 4> first{};
  return ::read(descriptor.get(), first.data(), first.size()) == ssize_t{4} && number_in(first) == kEbml;
}

}  // namespace nodal::host
