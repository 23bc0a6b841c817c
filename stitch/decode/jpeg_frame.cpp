#include "stitch/decode/jpeg_frame.h"

#include <turbojpeg.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "protocol/base/field.h"

namespace nodal::decode {
namespace {

constexpr std::uint8_t kSoi = 0xD8;
constexpr std::uint8_t kEoi = 0xD9;
constexpr std::uint8_t kSos = 0xDA;
constexpr std::uint8_t kApp0 = 0xE0;
constexpr std::uint8_t kFirstAlone = 0xD0;  // markers without a length: RST0..7, SOI, EOI
constexpr std::uint8_t kLastAlone = 0xD9;

/// The facts that decide how long a JPEG takes.
struct Frame {
  std::uint8_t process = 0;  ///< 0: baseline, 1: extended sequential, 2: progressive; others are not decoded
  int components = 0;
  int components_in_scan = 0;
  bool bottom_field = false;  ///< an AVI1 segment says that it is a bottom field
  std::size_t scan_at = 0;    ///< position of the scan's marker
};

bool is_start_of_frame(std::uint8_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

/// Reads the segments up to the first scan; nothing if there is none.
std::optional<Frame> read_segments(std::span<const std::uint8_t> jpeg) {
  if (jpeg.size() < 4 || jpeg[0] != 0xFF || jpeg[1] != kSoi) return std::nullopt;
  Frame frame;
  std::size_t at = 2;
  while (at + 4 <= jpeg.size()) {
    if (jpeg[at] != 0xFF) {
      ++at;  // bytes between segments
      continue;
    }
    const std::uint8_t marker = jpeg[at + 1];
    if (marker == 0xFF || marker == 0 || (marker >= kFirstAlone && marker <= kLastAlone)) {
      at += marker == 0xFF ? 1 : 2;
      continue;
    }
    const std::size_t length = std::size_t{jpeg[at + 2]} << 8 | jpeg[at + 3];
    if (length < 2 || at + 2 + length > jpeg.size()) return std::nullopt;
    if (is_start_of_frame(marker) && length >= 8) {
      frame.process = static_cast<std::uint8_t>(marker & 15);
      frame.components = jpeg[at + 9];
    }
    if (marker == kApp0 && length >= 7 && std::memcmp(&jpeg[at + 4], "AVI1", 4) == 0) {
      frame.bottom_field = jpeg[at + 8] == 2;
    }
    if (marker == kSos) {
      frame.scan_at = at;
      if (length < 3 || frame.components == 0) return std::nullopt;
      frame.components_in_scan = jpeg[at + 4];
      return frame;
    }
    at += 2 + length;
  }
  return std::nullopt;
}

/// What begins with the first SOI behind the EOI of the JPEG whose scan is at `scan_at`; empty if nothing does. Inside
/// of a scan's data FF D9 means EOI only (ITU-T T.81, B.1.1.5).
std::span<const std::uint8_t> next_jpeg(std::span<const std::uint8_t> jpegs, std::size_t scan_at) {
  std::uint8_t wanted = kEoi;
  for (std::size_t at = scan_at; at + 1 < jpegs.size(); ++at) {
    if (jpegs[at] != 0xFF || jpegs[at + 1] != wanted) continue;
    if (wanted == kSoi) return jpegs.subspan(at);
    wanted = kSoi;
  }
  return {};
}

std::uint8_t mean_of(int a, int b) { return static_cast<std::uint8_t>((a + b + 1) >> 1); }

/// A chroma plane of another subsampling to that of I420. `coarse`: it has a sample for four pixels of a row, in the
/// middle of them (4:1:1).
void resample(const PlaneView& from, bool coarse, const MutablePlaneView& into) {
  const bool all_rows = from.height > into.height;
  const bool all_columns = from.width > into.width;
  for (int y = 0; y < into.height; ++y) {
    const std::uint8_t* const upper = from.data + (all_rows ? 2 * y : y) * from.row_stride;
    const std::uint8_t* const lower = all_rows && 2 * y + 1 < from.height ? upper + from.row_stride : upper;
    std::uint8_t* const out = into.data + y * into.row_stride;
    const int last = from.width - 1;
    if (coarse) {
      for (int x = 0; x < into.width; ++x) {
        const int near = std::min(x / 2, last);
        const int far = std::clamp(x % 2 == 0 ? near - 1 : near + 1, 0, last);
        const int sum = 3 * (upper[near] + lower[near]) + upper[far] + lower[far];
        out[x] = static_cast<std::uint8_t>((sum + 4) >> 3);
      }
    } else if (all_columns) {
      for (int x = 0; x < into.width; ++x) {
        const int right = std::min(2 * x + 1, last);
        const int sum = upper[2 * x] + upper[right] + lower[2 * x] + lower[right];
        out[x] = static_cast<std::uint8_t>((sum + 2) >> 2);
      }
    } else {
      for (int x = 0; x < into.width; ++x) out[x] = mean_of(upper[x], lower[x]);
    }
  }
}

void copy(const PlaneView& from, const MutablePlaneView& into) {
  for (int y = 0; y < into.height; ++y) {
    std::copy_n(from.data + y * from.row_stride, into.width, into.data + y * into.row_stride);
  }
}

void fill(const MutablePlaneView& plane, std::uint8_t value) {
  for (int y = 0; y < plane.height; ++y) std::fill_n(plane.data + y * plane.row_stride, plane.width, value);
}

// Frames are refused for every warning but one, see only_superfluous_bytes(); TurboJPEG then still returns -1.
constexpr int kFlags = 0;

}  // namespace

FieldParity first_field_of(std::span<const std::uint8_t> jpegs) {
  const auto frame = read_segments(jpegs);
  return frame && frame->bottom_field ? FieldParity::kBottom : FieldParity::kTop;
}

std::string_view decode_fault_text(DecodeFault fault) {
  switch (fault) {
    case DecodeFault::kNone: return "are good";
    case DecodeFault::kNoJpeg: return "are no JPEGs, or end in their header";
    case DecodeFault::kBroken: return "end early or are damaged; use a shorter or better cable, or a lower rate";
    case DecodeFault::kOtherSize: return "have another size than the head's; change size in rig.toml";
    case DecodeFault::kOtherCoding: return "are not Y U V or grey of 8 bits; choose another format in rig.toml";
    case DecodeFault::kSeveralScans:
      return "are progressive or have several scans, which take too long to decode; choose another format in rig.toml";
  }
  return "cannot be decoded";
}

void JpegDecoder::Close::operator()(void* handle) const { tjDestroy(handle); }

JpegDecoder::JpegDecoder() : handle_(tjInitDecompress()) {}

/// A warning about bytes between segments or after the data says nothing about the picture; many cameras cause it.
bool JpegDecoder::only_superfluous_bytes() const {
  return tjGetErrorCode(handle_.get()) == TJERR_WARNING &&
         std::strstr(tjGetErrorStr2(handle_.get()), "extraneous bytes") != nullptr;
}

/// TurboJPEG writes whole blocks of samples that share chroma, so a picture of odd size gets rows and columns of luma
/// that it does not have. Such luma, and chroma of another subsampling, go through scratch memory.
int JpegDecoder::decode_planes(std::span<const std::uint8_t> jpeg, int subsampling, const MutableImageView& into) {
  std::array<MutablePlaneView, kMaxPlanes> decoded = into.planes;
  std::array<bool, kMaxPlanes> apart{};
  const bool grey = subsampling == TJSAMP_GRAY;
  std::size_t bytes = 0;
  for (int c = 0; c < (grey ? 1 : kMaxPlanes); ++c) {
    MutablePlaneView& plane = decoded[static_cast<std::size_t>(c)];
    const int width = tjPlaneWidth(c, into.width, subsampling);
    const int height = tjPlaneHeight(c, into.height, subsampling);
    if (width == plane.width && height == plane.height) continue;
    apart[static_cast<std::size_t>(c)] = true;
    plane = {nullptr, width, height, width, 1};
    bytes += static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  scratch_.resize(std::max(scratch_.size(), bytes));
  std::uint8_t* next = scratch_.data();
  std::array<unsigned char*, kMaxPlanes> data{};
  std::array<int, kMaxPlanes> strides{};
  for (std::size_t c = 0; c < kMaxPlanes; ++c) {
    if (apart[c]) {
      decoded[c].data = next;
      next += decoded[c].row_stride * decoded[c].height;
    }
    data[c] = decoded[c].data;
    strides[c] = static_cast<int>(decoded[c].row_stride);
  }
  const int status = tjDecompressToYUVPlanes(handle_.get(), jpeg.data(), jpeg.size(), data.data(), into.width,
                                             strides.data(), into.height, kFlags);
  for (std::size_t c = 0; c < kMaxPlanes; ++c) {
    const MutablePlaneView& plane = into.planes[c];
    const PlaneView from{decoded[c].data, decoded[c].width, decoded[c].height, decoded[c].row_stride, 1};
    if (grey && c > 0) {
      fill(plane, 128);
    } else if (apart[c] && c == 0) {
      copy(from, plane);
    } else if (apart[c]) {
      resample(from, subsampling == TJSAMP_411, plane);
    }
  }
  return status;
}

DecodeFault JpegDecoder::decode(std::span<const std::uint8_t> jpeg, const MutableImageView& into) {
  const DecodeFault fault = try_to_decode(jpeg, into);
  // After an error TurboJPEG may read the next frame as the continuation of this one.
  if (fault != DecodeFault::kNone) handle_.reset(tjInitDecompress());
  return fault;
}

DecodeFault JpegDecoder::open(std::span<const std::uint8_t> jpeg, Opened& opened) {
  const auto frame = read_segments(jpeg);
  if (!frame) return DecodeFault::kNoJpeg;
  if (frame->process > 1 || frame->components_in_scan != frame->components) return DecodeFault::kSeveralScans;
  opened.jpeg = jpeg;
  opened.bottom_field = frame->bottom_field;
  opened.scan_at = frame->scan_at;
  int colours = 0;
  if (!handle_ || tjDecompressHeader3(handle_.get(), jpeg.data(), jpeg.size(), &opened.width, &opened.height,
                                      &opened.subsampling, &colours) != 0) {
    return DecodeFault::kOtherCoding;
  }
  return colours == TJCS_YCbCr || colours == TJCS_GRAY ? DecodeFault::kNone : DecodeFault::kOtherCoding;
}

DecodeFault JpegDecoder::decode_opened(const Opened& opened, const MutableImageView& into) {
  if (opened.width != into.width || opened.height != into.height) return DecodeFault::kOtherSize;
  int status = 0;
  if (into.format == PixelFormat::kI420) {
    status = decode_planes(opened.jpeg, opened.subsampling, into);
  } else {
    status = tjDecompress2(handle_.get(), opened.jpeg.data(), opened.jpeg.size(), into.planes[0].data, opened.width,
                           static_cast<int>(into.planes[0].row_stride), opened.height,
                           into.format == PixelFormat::kGrey8 ? TJPF_GRAY : TJPF_RGB, kFlags);
  }
  return status == 0 || only_superfluous_bytes() ? DecodeFault::kNone : DecodeFault::kBroken;
}

DecodeFault JpegDecoder::try_to_decode(std::span<const std::uint8_t> jpeg, const MutableImageView& into) {
  Opened opened;
  if (const DecodeFault fault = open(jpeg, opened); fault != DecodeFault::kNone) return fault;
  const int rows_of_fields = into.format == PixelFormat::kI420 ? 4 : 2;
  if (opened.width != into.width || 2 * opened.height != into.height || into.height % rows_of_fields != 0) {
    return decode_opened(opened, into);
  }
  const FieldParity first = opened.bottom_field ? FieldParity::kBottom : FieldParity::kTop;
  const auto second = next_jpeg(jpeg, opened.scan_at);
  if (second.empty()) return DecodeFault::kOtherSize;
  opened.jpeg = jpeg.first(jpeg.size() - second.size());
  if (const DecodeFault fault = decode_opened(opened, field_of(into, first)); fault != DecodeFault::kNone) return fault;
  if (const DecodeFault fault = open(second, opened); fault != DecodeFault::kNone) return fault;
  return decode_opened(opened, field_of(into, other(first)));
}

}  // namespace nodal::decode
