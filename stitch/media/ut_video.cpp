#include "stitch/media/ut_video.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>
#include <utility>

#include "protocol/base/try.h"

namespace nodal::media {
namespace {

/// Longer codes are hardly more compact, and this many bits index a table of the decoder that fits a cache.
constexpr std::uint32_t kLongestCode = 14;
constexpr std::size_t kSymbols = 256;
constexpr std::uint8_t kUnused = 255;  ///< length of the code of a symbol that does not occur
constexpr std::uint8_t kFirst = 128;   ///< predicts a plane's first sample
constexpr std::size_t kPlaneHead = kSymbols + 4;
constexpr std::size_t kFrameEnd = 4;
constexpr std::uint32_t kLeft = 1;  ///< the prediction, in bits 8 and 9 of the frame's last word

using Lengths = std::array<std::uint8_t, kSymbols>;
using Counts = std::array<std::uint32_t, kSymbols>;
struct Code {
  std::uint32_t bits = 0;
  std::uint32_t length = 0;
};

bool is_rgb(PixelFormat format) { return format == PixelFormat::kRgb24; }
bool halves_rows(PixelFormat format) { return format == PixelFormat::kI420 || format == PixelFormat::kNv12; }

/// With the matrix of ITU-R BT.709 it has a name of its own.
std::string_view fourcc_for(PixelFormat format, ColourCoding coding) {
  if (is_rgb(format)) return "ULRG";
  if (halves_rows(format)) return coding.bt709 ? "ULH0" : "ULY0";
  return coding.bt709 ? "ULH2" : "ULY2";
}

/// Huffman's code lengths (two queues). `used` is sorted by count. Returns the longest.
std::uint32_t huffman(std::span<const std::uint8_t> used, const Counts& count, Lengths& lengths) {
  const std::size_t leaves = used.size();
  std::array<std::uint64_t, 2 * kSymbols> weight{};
  std::array<std::size_t, 2 * kSymbols> parent{};
  for (std::size_t i = 0; i < leaves; ++i) weight[i] = count[used[i]];
  std::size_t leaf = 0, node = leaves, end = leaves;
  const auto lightest = [&] {
    return leaf < leaves && (node == end || weight[leaf] <= weight[node]) ? leaf++ : node++;
  };
  while (end < 2 * leaves - 1) {
    const std::size_t a = lightest(), b = lightest();
    weight[end] = weight[a] + weight[b];
    parent[a] = parent[b] = end++;
  }
  std::array<std::uint32_t, 2 * kSymbols> depth{};
  std::uint32_t longest = 0;
  for (std::size_t i = 2 * leaves - 2; i-- > 0;) {
    depth[i] = depth[parent[i]] + 1;
    if (i >= leaves) continue;
    lengths[used[i]] = static_cast<std::uint8_t>(depth[i]);
    longest = std::max(longest, depth[i]);
  }
  return longest;
}

/// Counts are halved until no code is too long. A code that is longer than 8 bits on average is replaced by one of 8.
Lengths lengths_for(Counts count) {
  Lengths lengths;
  lengths.fill(kUnused);
  const Counts all = count;
  std::array<std::uint8_t, kSymbols> symbols;
  std::size_t found = 0;
  for (std::size_t i = 0; i < kSymbols; ++i) {
    if (count[i] != 0) symbols[found++] = static_cast<std::uint8_t>(i);
  }
  const std::span<std::uint8_t> used = std::span(symbols).first(found);
  if (used.size() == 1) {
    lengths[used[0]] = 0;
    return lengths;
  }
  for (;;) {
    std::ranges::sort(used, {}, [&](std::uint8_t symbol) { return std::pair(count[symbol], symbol); });
    if (huffman(used, count, lengths) <= kLongestCode) break;
    for (const std::uint8_t symbol : used) count[symbol] = count[symbol] / 2 + 1;
  }
  std::uint64_t bits = 0, samples = 0;
  for (const std::uint8_t symbol : used) {
    bits += std::uint64_t{all[symbol]} * lengths[symbol];
    samples += all[symbol];
  }
  if (bits > 8 * samples) lengths.fill(8);
  return lengths;
}

/// Ut Video's code: the longest codes come first, of equally long ones that of the largest symbol.
std::array<Code, kSymbols> codes_of(const Lengths& lengths) {
  std::array<std::uint8_t, kSymbols> order;
  std::iota(order.begin(), order.end(), std::uint8_t{0});
  std::ranges::sort(order, {}, [&](std::uint8_t symbol) { return std::pair(lengths[symbol], symbol); });
  std::array<Code, kSymbols> codes{};
  std::uint64_t next = 0;  // next code, in units of 2^-32
  for (std::size_t i = kSymbols; i-- > 0;) {
    const std::uint32_t length = lengths[order[i]];
    if (length == 0 || length == kUnused) continue;
    codes[order[i]] = {static_cast<std::uint32_t>(next >> (32 - length)), length};
    next += std::uint64_t{1} << (32 - length);
  }
  return codes;
}

Counts count_of(const std::vector<std::uint8_t>& bytes) {
  std::array<Counts, 4> part{};  // neighbours are often equal, and a counter cannot rise twice at once
  std::size_t i = 0;
  for (; i + 4 <= bytes.size(); i += 4) {
    for (std::size_t k = 0; k < 4; ++k) ++part[k][bytes[i + k]];
  }
  for (; i < bytes.size(); ++i) ++part[0][bytes[i]];
  Counts sum;
  for (std::size_t s = 0; s < kSymbols; ++s) sum[s] = part[0][s] + part[1][s] + part[2][s] + part[3][s];
  return sum;
}

template <class Word>
void store(std::uint8_t* at, Word word) {
  for (std::size_t k = 0; k < sizeof word; ++k) at[k] = static_cast<std::uint8_t>(word >> (8 * k));
}
std::uint32_t load(const std::uint8_t* at) {
  return at[0] | std::uint32_t{at[1]} << 8 | std::uint32_t{at[2]} << 16 | std::uint32_t{at[3]} << 24;
}

/// A component without padding.
void gather(const PlaneView& plane, std::vector<std::uint8_t>& into) {
  into.resize(static_cast<std::size_t>(plane.width) * static_cast<std::size_t>(plane.height));
  std::uint8_t* to = into.data();
  for (int y = 0; y < plane.height; ++y) {
    const std::uint8_t* from = plane.data + y * plane.row_stride;
    if (plane.pixel_stride == 1) {
      to = std::copy_n(from, plane.width, to);
    } else {
      for (int x = 0; x < plane.width; ++x) *to++ = from[x * plane.pixel_stride];
    }
  }
}

/// The components in the order in which they are stored: Y U V, or G B R.
std::array<std::size_t, 3> order_of(PixelFormat format) {
  return is_rgb(format) ? std::array<std::size_t, 3>{1, 2, 0} : std::array<std::size_t, 3>{0, 1, 2};
}

/// The bits of a plane: words of 32 bits, the first bit is the most significant one.
class BitReader {
 public:
  explicit BitReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  /// The next kLongestCode bits; zeros behind the end.
  std::uint32_t peek() {
    if (left_ < kLongestCode) {
      buffer_ = buffer_ << 32 | (at_ + 4 <= bytes_.size() ? load(&bytes_[at_]) : 0);
      at_ += 4;
      left_ += 32;
    }
    return static_cast<std::uint32_t>(buffer_ >> (left_ - kLongestCode)) & ((1U << kLongestCode) - 1);
  }
  void skip(std::uint32_t bits) { left_ -= bits; }
  bool beyond() const { return at_ > bytes_.size() + left_ / 8; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::uint64_t buffer_ = 0;
  std::uint32_t left_ = 0;
};

Status decode_plane(std::span<const std::uint8_t>& frame, std::vector<std::uint8_t>& plane) {
  if (frame.size() < kPlaneHead) return fail(Errc::kTruncated, "a frame of Ut Video ends in a plane's codes");
  Lengths lengths;
  std::copy_n(frame.begin(), kSymbols, lengths.begin());
  const std::size_t size = load(&frame[kSymbols]);
  frame = frame.subspan(kPlaneHead);
  if (size > frame.size() || size % 4 != 0) return fail(Errc::kTruncated, "a frame of Ut Video ends in a plane");
  BitReader bits(frame.first(size));
  frame = frame.subspan(size);
  std::uint8_t sample = kFirst;
  if (const auto only = std::ranges::find(lengths, 0); only != lengths.end()) {
    const auto step = static_cast<std::uint8_t>(only - lengths.begin());
    for (std::uint8_t& each : plane) each = sample = static_cast<std::uint8_t>(sample + step);
    return {};
  }
  struct Entry {
    std::uint8_t symbol = 0, length = 0;
  };
  std::array<Entry, std::size_t{1} << kLongestCode> table;
  std::size_t filled = 0;
  for (const std::uint8_t length : lengths) {
    if (length == kUnused) continue;
    if (length > kLongestCode) return fail(Errc::kBadFormat, "a plane of Ut Video has codes that are too long");
    filled += std::size_t{1} << (kLongestCode - length);
  }
  if (filled != table.size()) return fail(Errc::kBadFormat, "a plane of Ut Video has no complete code");
  const auto codes = codes_of(lengths);
  for (std::size_t symbol = 0; symbol < kSymbols; ++symbol) {
    if (lengths[symbol] == kUnused) continue;
    const std::uint32_t free_bits = kLongestCode - lengths[symbol];
    std::fill_n(table.begin() + (codes[symbol].bits << free_bits), std::size_t{1} << free_bits,
                Entry{static_cast<std::uint8_t>(symbol), lengths[symbol]});
  }
  for (std::uint8_t& each : plane) {
    const Entry entry = table[bits.peek()];
    bits.skip(entry.length);
    each = sample = static_cast<std::uint8_t>(sample + entry.symbol);
  }
  if (bits.beyond()) return fail(Errc::kTruncated, "a plane of Ut Video has too few bits");
  return {};
}

}  // namespace

bool ut_video_codes(PixelFormat format, int width, int height) {
  if (is_rgb(format)) return true;
  const bool yuv = halves_rows(format) || format == PixelFormat::kI422 || format == PixelFormat::kYuyv ||
                   format == PixelFormat::kUyvy;
  return yuv && width % 2 == 0 && (!halves_rows(format) || height % 2 == 0);
}

std::vector<std::uint8_t> ut_video_private(PixelFormat format, int width, int height, ColourCoding coding,
                                           Fields fields) {
  constexpr std::size_t kHeader = 40, kExtra = 16;
  std::vector<std::uint8_t> data(kHeader + kExtra);
  store(&data[0], static_cast<std::uint32_t>(data.size()));
  store(&data[4], static_cast<std::uint32_t>(width));
  store(&data[8], static_cast<std::uint32_t>(height));
  store(&data[12], std::uint16_t{1});   // planes
  store(&data[14], std::uint16_t{24});  // bits of a pixel
  std::ranges::copy(fourcc_for(format, coding), data.begin() + 16);
  store(&data[kHeader], std::uint32_t{0x0100'00F0});  // the encoder's version: none of the original ones
  store(&data[kHeader + 8], static_cast<std::uint32_t>(kFrameEnd));
  constexpr std::uint32_t kHuffman = 1, kInterlaced = 0x800;  // one slice
  const bool marked = fields == Fields::kBottomFirst && height % (halves_rows(format) ? 4 : 2) == 0;
  store(&data[kHeader + 12], marked ? kHuffman | kInterlaced : kHuffman);
  return data;
}

std::size_t ut_video_most_bytes(PixelFormat format, int width, int height) {
  return packed_size(format, width, height) + 3 * (kPlaneHead + 8) + kFrameEnd;
}

void UtVideoEncoder::encode(const ImageView& picture, std::vector<std::uint8_t>& into) {
  into.resize(ut_video_most_bytes(picture.format, picture.width, picture.height));
  std::size_t size = 0;
  const auto order = order_of(picture.format);
  for (std::size_t k = 0; k < order.size(); ++k) {
    gather(picture.planes[order[k]], plane_);
    if (is_rgb(picture.format)) {
      if (k == 0) first_ = plane_;
      for (std::size_t i = 0; k > 0 && i < plane_.size(); ++i)
        plane_[i] = static_cast<std::uint8_t>(plane_[i] - first_[i] + kFirst);
    }
    encode_plane(into, size);
  }
  store(&into[size], kLeft << 8);
  into.resize(size + kFrameEnd);
}

void UtVideoEncoder::encode_plane(std::vector<std::uint8_t>& into, std::size_t& size) {
  const std::size_t samples = plane_.size();
  differences_.resize(samples);
  differences_[0] = static_cast<std::uint8_t>(plane_[0] - kFirst);
  for (std::size_t i = 1; i < samples; ++i) differences_[i] = static_cast<std::uint8_t>(plane_[i] - plane_[i - 1]);
  const Lengths lengths = lengths_for(count_of(differences_));
  std::ranges::copy(lengths, into.begin() + static_cast<std::ptrdiff_t>(size));
  std::uint8_t* const begin = into.data() + size + kPlaneHead;
  std::uint8_t* at = begin;
  if (std::ranges::find(lengths, 0) == lengths.end()) {
    const auto codes = codes_of(lengths);
    std::uint64_t buffer = 0;
    std::uint32_t bits = 0;  // bits in the buffer, less than 32 after a flush
    const auto put = [&](std::uint32_t code, std::uint32_t length) {
      buffer = buffer << length | code;
      bits += length;
      if (bits < 32) return;
      bits -= 32;
      store(at, static_cast<std::uint32_t>(buffer >> bits));
      at += 4;
    };
    std::size_t i = 0;
    for (; i + 2 <= samples; i += 2) {
      const Code& a = codes[differences_[i]];
      const Code& b = codes[differences_[i + 1]];
      put(a.bits << b.length | b.bits, a.length + b.length);
    }
    if (i < samples) put(codes[differences_[i]].bits, codes[differences_[i]].length);
    if (bits > 0) put(0, 32 - bits);
  }
  store(begin - 4, static_cast<std::uint32_t>(at - begin));
  size += kPlaneHead + static_cast<std::size_t>(at - begin);
}

Status decode_ut_video(std::span<const std::uint8_t> frame, PixelFormat format, int width, int height,
                       std::vector<std::uint8_t>& into) {
  if (frame.size() < kFrameEnd) return fail(Errc::kTruncated, "a frame of Ut Video ends before its last word");
  if ((load(&frame[frame.size() - kFrameEnd]) >> 8 & 3) != kLeft)
    return fail(Errc::kBadFormat, "a frame of Ut Video has another prediction than from the left");
  into.resize(packed_size(format, width, height));
  const MutableImageView picture = packed_image(format, width, height, into.data());
  std::vector<std::uint8_t> plane, first;
  const auto order = order_of(format);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const MutablePlaneView& to = picture.planes[order[k]];
    plane.resize(static_cast<std::size_t>(to.width) * static_cast<std::size_t>(to.height));
    NODAL_TRY(decode_plane(frame, plane));
    if (is_rgb(format)) {
      if (k == 0) first = plane;
      for (std::size_t i = 0; k > 0 && i < plane.size(); ++i)
        plane[i] = static_cast<std::uint8_t>(plane[i] + first[i] - kFirst);
    }
    const std::uint8_t* from = plane.data();
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) to.data[y * to.row_stride + x * to.pixel_stride] = *from++;
    }
  }
  if (frame.size() != kFrameEnd)
    return fail(Errc::kTruncated, "a frame of Ut Video has another length than its planes");
  return {};
}

}  // namespace nodal::media
