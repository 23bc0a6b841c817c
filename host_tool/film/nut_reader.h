// Reads what `ffmpeg -f nut` writes to a pipe: one stream of raw pictures with their exact times (ffmpeg.org/~michael/
// nut.txt, version 3). Neither rawvideo nor YUV4MPEG2 have times.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "host_tool/film/rational.h"
#include "protocol/base/result.h"

namespace nodal::film {

struct NutVideo {
  int width = 0;
  int height = 0;
  Rational time_base;  ///< seconds per unit of a frame's time
};

/// Memory: one frame of the caller's, headers of at most kMaxHeader bytes.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: kBadFormat, kTruncated, kTooLarge, kUnsupported; those of `read`.
class NutReader {
 public:
  static constexpr std::size_t kMaxHeader = 1 << 16;

  /// Fills a part of the span, and returns how much; 0: the end.
  using Read = std::function<Result<std::size_t>(std::span<std::uint8_t>)>;
  explicit NutReader(Read read) : read_(std::move(read)), buffer_(kBuffer) {}

  /// Reads up to the first frame. An end before any header is kTruncated.
  Result<NutVideo> begin();
  /// The next frame, into all of `into`; its time in units of the time base; nothing at the end.
  /// Errors: kBadFormat for a frame of another size.
  Result<std::optional<std::int64_t>> next(std::span<std::uint8_t> into);

 private:
  static constexpr std::size_t kBuffer = 1 << 16;
  struct FrameCode {
    std::uint64_t flags = 0, stream = 0, size_multiplier = 1, size_lsb = 0, reserved = 0, header = 0;
    std::int64_t pts_delta = 0;
  };
  class Header;

  Result<bool> fill();
  Result<std::uint8_t> byte();
  Result<std::uint64_t> number();
  Result<std::uint64_t> big_endian(int bytes);
  Status bytes(std::span<std::uint8_t> into);
  Status skip(std::uint64_t count);
  Status packet(std::uint64_t start_code);
  Status main_header(Header& header);
  Status frame_codes(Header& header);
  Status stream_header(Header& header);
  Status syncpoint(Header& header);
  Result<std::int64_t> frame(std::uint8_t code, std::span<std::uint8_t> into);

  Read read_;
  std::vector<std::uint8_t> buffer_;
  std::size_t at_ = 0, end_ = 0;
  bool has_main_ = false, has_stream_ = false;
  std::vector<Rational> time_bases_;
  std::array<FrameCode, 256> codes_{};
  std::vector<std::vector<std::uint8_t>> elided_{{}};  ///< beginnings of frames that are left out; the first is empty
  NutVideo video_;
  std::uint32_t msb_shift_ = 0;
  std::int64_t last_pts_ = 0;
  std::optional<std::uint8_t> next_code_;  ///< the first byte of a frame that begin() has read
};

}  // namespace nodal::film
