#include "host_tool/film/nut_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <string_view>

#include "protocol/base/try.h"

namespace nodal::film {
namespace {

constexpr std::string_view kFileId{"nut/multimedia container\0", 25};
constexpr std::uint64_t kMain = 0x4E4D7A561F5F04AD, kStream = 0x4E5311405BF2F9DB, kSync = 0x4E4BE4ADEECA4569,
                        kIndex = 0x4E58DD672F23E64E, kInfo = 0x4E49AB68B596BA78;
// Flags of a frame.
constexpr std::uint64_t kCodedPts = 8, kStreamId = 16, kSizeMsb = 32, kChecksum = 64, kReserved = 128, kSideData = 256,
                        kHeaderIndex = 1024, kMatchTime = 2048, kCodedFlags = 4096, kInvalid = 8192;
constexpr std::uint64_t kMaxTerm = std::uint64_t{1} << 31;
constexpr std::size_t kMaxTimeBases = 16, kMaxElided = 128, kMaxElidedBytes = 256;
constexpr std::int64_t kMaxPts = std::int64_t{1} << 60;

auto bad(std::string_view what) { return fail(Errc::kBadFormat, fmt::format("the decoder's output: {}", what)); }
auto cut() { return fail(Errc::kTruncated, "the decoder's output ends within a frame"); }

}  // namespace

/// The fields of one header, which is in memory.
class NutReader::Header {
 public:
  explicit Header(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  bool good() const { return good_; }
  std::uint64_t number() {
    std::uint64_t value = 0;
    for (;;) {
      if (at_ == bytes_.size() || value >> 56 != 0) return good_ = false, 0;
      const std::uint8_t next = bytes_[at_++];
      value = value << 7 | (next & 0x7F);
      if ((next & 0x80) == 0) return value;
    }
  }
  std::int64_t signed_number() {
    const std::uint64_t value = number() + 1;
    const auto half = static_cast<std::int64_t>(value >> 1);
    return (value & 1) != 0 ? -half : half;
  }
  std::span<const std::uint8_t> bytes() {
    const std::uint64_t size = number();
    if (size > bytes_.size() - at_) return good_ = false, std::span<const std::uint8_t>{};
    at_ += size;
    return bytes_.subspan(at_ - size, size);
  }
  std::size_t rest() const { return bytes_.size() - at_; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool good_ = true;
};

Result<bool> NutReader::fill() {
  if (at_ < end_) return true;
  NODAL_TRY_ASSIGN(end_, read_(buffer_));
  at_ = 0;
  return end_ > 0;
}

Result<std::uint8_t> NutReader::byte() {
  NODAL_TRY_ASSIGN(const bool more, fill());
  if (!more) return cut();
  return buffer_[at_++];
}

Result<std::uint64_t> NutReader::number() {
  std::uint64_t value = 0;
  for (;;) {
    if (value >> 56 != 0) return bad("a number is over 63 bits");
    NODAL_TRY_ASSIGN(const std::uint8_t next, byte());
    value = value << 7 | (next & 0x7F);
    if ((next & 0x80) == 0) return value;
  }
}

Result<std::uint64_t> NutReader::big_endian(int count) {
  std::uint64_t value = 0;
  for (int i = 0; i < count; ++i) {
    NODAL_TRY_ASSIGN(const std::uint8_t next, byte());
    value = value << 8 | next;
  }
  return value;
}

Status NutReader::bytes(std::span<std::uint8_t> into) {
  const std::size_t here = std::min(into.size(), end_ - at_);
  std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(at_), here, into.begin());
  at_ += here;
  into = into.subspan(here);
  while (!into.empty()) {
    NODAL_TRY_ASSIGN(const std::size_t count, read_(into));
    if (count == 0) return cut();
    into = into.subspan(count);
  }
  return {};
}

Status NutReader::skip(std::uint64_t count) {
  while (count > 0) {
    NODAL_TRY_ASSIGN(const bool more, fill());
    if (!more) return cut();
    const std::size_t here = std::min<std::uint64_t>(count, end_ - at_);
    at_ += here;
    count -= here;
  }
  return {};
}

Status NutReader::main_header(Header& header) {
  if (header.number() != 3) return fail(Errc::kUnsupported, "the decoder's output is not NUT of version 3");
  if (header.number() != 1) return bad("it has not one stream");
  header.number();  // max_distance
  const std::uint64_t count = header.number();
  if (count == 0 || count > kMaxTimeBases) return bad("its time bases");
  time_bases_.clear();
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t num = header.number(), den = header.number();
    if (num == 0 || den == 0 || num > kMaxTerm || den > kMaxTerm) return bad("a time base");
    time_bases_.push_back({static_cast<std::int64_t>(num), static_cast<std::int64_t>(den)});
  }
  NODAL_TRY(frame_codes(header));
  elided_.assign(1, {});
  if (header.rest() > 0) {
    const std::uint64_t headers = header.number();
    if (headers > kMaxElided) return bad("its elision headers");
    for (std::uint64_t i = 0; i < headers; ++i) {
      const auto bytes = header.bytes();
      if (bytes.size() > kMaxElidedBytes) return bad("its elision headers");
      elided_.emplace_back(bytes.begin(), bytes.end());
    }
  }
  if (!header.good()) return bad("its main header is cut");
  has_main_ = true;
  return {};
}

Status NutReader::frame_codes(Header& header) {
  std::uint64_t multiplier = 1, stream = 0, elided = 0;
  std::int64_t delta = 0;
  for (std::size_t code = 0; code < codes_.size();) {
    if (!header.good()) return bad("its main header is cut");
    const std::uint64_t flags = header.number(), fields = header.number();
    if (fields > 64) return bad("its frame codes");
    std::uint64_t size = 0, reserved = 0;
    if (fields > 0) delta = header.signed_number();
    if (fields > 1) multiplier = header.number();
    if (fields > 2) stream = header.number();
    if (fields > 3) size = header.number();
    if (fields > 4) reserved = header.number();
    std::uint64_t count = multiplier - size;
    if (fields > 5) count = header.number();
    if (fields > 6) header.signed_number();
    if (fields > 7) elided = header.number();
    for (std::uint64_t more = 8; more < fields; ++more) header.number();
    if (!header.good() || count == 0 || count > codes_.size() - code + 1 || multiplier > kMaxTerm || size > kMaxTerm ||
        delta > kMaxPts || delta < -kMaxPts) {
      return bad("its frame codes");
    }
    for (std::uint64_t k = 0; k < count && code < codes_.size(); ++code) {
      if (code == 'N') {
        codes_[code].flags = kInvalid;
        continue;
      }
      codes_[code] = {flags, stream, multiplier, size + k, reserved, elided, delta};
      ++k;
    }
  }
  return {};
}

Status NutReader::stream_header(Header& header) {
  if (!has_main_) return bad("a stream is before the main header");
  const std::uint64_t id = header.number(), kind = header.number();
  header.bytes();  // fourcc: the caller asked for the pixels' format
  const std::uint64_t time_base = header.number(), shift = header.number();
  header.number();  // max_pts_distance
  header.number();  // decode_delay
  header.number();  // flags
  header.bytes();   // codec-specific data
  const std::uint64_t width = header.number(), height = header.number();
  if (!header.good() || id != 0 || kind != 0 || time_base >= time_bases_.size() || shift >= 16) {
    return bad("its stream header");
  }
  if (width == 0 || height == 0 || width > 65536 || height > 65536) return bad("the size of its pictures");
  video_ = {static_cast<int>(width), static_cast<int>(height), time_bases_[time_base]};
  msb_shift_ = static_cast<std::uint32_t>(shift);
  has_stream_ = true;
  return {};
}

/// Times count from a syncpoint on.
Status NutReader::syncpoint(Header& header) {
  if (!has_stream_) return bad("a syncpoint is before the stream header");
  const std::uint64_t coded = header.number();
  if (!header.good()) return bad("a syncpoint is cut");
  const Rational base = time_bases_[coded % time_bases_.size()];
  const auto count = static_cast<std::int64_t>(coded / time_bases_.size());
  if (count > kMaxPts) return bad("the time of a syncpoint");
  const Wide exact = Wide{count} * base.num * video_.time_base.den / (Wide{base.den} * video_.time_base.num);
  if (exact > kMaxPts) return bad("the time of a syncpoint");
  last_pts_ = static_cast<std::int64_t>(exact);
  return {};
}

Status NutReader::packet(std::uint64_t start_code) {
  NODAL_TRY_ASSIGN(const std::uint64_t size, number());
  constexpr std::uint64_t kLongHeader = 4096;
  if (size > kLongHeader) NODAL_TRY(big_endian(4));  // checksum
  const bool wanted = start_code == kMain || start_code == kStream || start_code == kSync;
  if (!wanted && start_code != kIndex && start_code != kInfo) return bad("a packet of an unknown kind");
  if (!wanted) return skip(size);
  if (size > kMaxHeader) return fail(Errc::kTooLarge, "the decoder's output: a header is over 64 KiB");
  if (size < 4) return bad("a header without a checksum");
  std::vector<std::uint8_t> content(size);
  NODAL_TRY(bytes(content));
  Header header{std::span<const std::uint8_t>(content).first(size - 4)};
  if (start_code == kMain) return main_header(header);
  if (start_code == kStream) return stream_header(header);
  return syncpoint(header);
}

Result<NutVideo> NutReader::begin() {
  for (const char wanted : kFileId) {
    NODAL_TRY_ASSIGN(const std::uint8_t got, byte());
    if (got != static_cast<std::uint8_t>(wanted)) return bad("it is not NUT");
  }
  for (;;) {
    NODAL_TRY_ASSIGN(const bool more, fill());
    if (!more && has_stream_) return video_;
    NODAL_TRY_ASSIGN(const std::uint8_t first, byte());
    if (first != 'N') {
      if (!has_stream_) return bad("a frame is before the headers");
      next_code_ = first;
      return video_;
    }
    NODAL_TRY_ASSIGN(const std::uint64_t rest, big_endian(7));
    NODAL_TRY(packet(std::uint64_t{'N'} << 56 | rest));
  }
}

Result<std::optional<std::int64_t>> NutReader::next(std::span<std::uint8_t> into) {
  for (;;) {
    if (!next_code_) {
      NODAL_TRY_ASSIGN(const bool more, fill());
      if (!more) return std::nullopt;
      NODAL_TRY_ASSIGN(next_code_, byte());
    }
    const std::uint8_t code = *next_code_;
    next_code_.reset();
    if (code != 'N') {
      NODAL_TRY_ASSIGN(const std::int64_t pts, frame(code, into));
      return pts;
    }
    NODAL_TRY_ASSIGN(const std::uint64_t rest, big_endian(7));
    NODAL_TRY(packet(std::uint64_t{'N'} << 56 | rest));
  }
}

Result<std::int64_t> NutReader::frame(std::uint8_t code, std::span<std::uint8_t> into) {
  const FrameCode& known = codes_[code];
  std::uint64_t flags = known.flags, stream = known.stream, elided = known.header, reserved = known.reserved, msb = 0;
  if ((flags & kInvalid) != 0) return bad("a frame code that is not in use");
  if ((flags & kCodedFlags) != 0) {
    NODAL_TRY_ASSIGN(const std::uint64_t changed, number());
    flags ^= changed;
  }
  if ((flags & kStreamId) != 0) {
    NODAL_TRY_ASSIGN(stream, number());
  }
  std::int64_t pts = last_pts_ + known.pts_delta;
  if ((flags & kCodedPts) != 0) {
    NODAL_TRY_ASSIGN(const std::uint64_t coded, number());
    const std::uint64_t unit = std::uint64_t{1} << msb_shift_;
    if (coded >= unit) {
      pts = static_cast<std::int64_t>(coded - unit);
    } else {  // the low bits of a time near the one before
      const auto mask = static_cast<std::int64_t>(unit - 1);
      const std::int64_t least = last_pts_ - mask / 2;
      pts = ((static_cast<std::int64_t>(coded) - least) & mask) + least;
    }
  }
  if ((flags & kSizeMsb) != 0) {
    NODAL_TRY_ASSIGN(msb, number());
  }
  if ((flags & kMatchTime) != 0) NODAL_TRY(number());
  if ((flags & kHeaderIndex) != 0) {
    NODAL_TRY_ASSIGN(elided, number());
  }
  if ((flags & kReserved) != 0) {
    NODAL_TRY_ASSIGN(reserved, number());
  }
  if (reserved > 64) return bad("a frame's reserved fields");
  for (std::uint64_t i = 0; i < reserved; ++i) NODAL_TRY(number());
  if ((flags & kChecksum) != 0) NODAL_TRY(big_endian(4));
  if ((flags & kSideData) != 0) return fail(Errc::kUnsupported, "the decoder's output: a frame with side data");
  if (stream != 0 || elided >= elided_.size()) return bad("a frame of another stream");
  if (pts > kMaxPts || pts < -kMaxPts) return bad("the time of a frame");
  if (msb > kMaxTerm) return bad("the size of a frame");
  const std::uint64_t size = known.size_lsb + msb * known.size_multiplier;
  if (size != into.size()) {
    return bad(fmt::format("a frame has {} bytes, and its pictures have {}: the picture size changes in the film", size,
                           into.size()));
  }
  constexpr std::size_t kMaxElidedFrame = 4096;  // larger frames are whole
  const std::vector<std::uint8_t>& front = elided_[size > kMaxElidedFrame ? 0 : elided];
  if (front.size() > into.size()) return bad("a frame's elision header");
  std::ranges::copy(front, into.begin());
  NODAL_TRY(bytes(into.subspan(front.size())));
  last_pts_ = pts;
  return pts;
}

}  // namespace nodal::film
