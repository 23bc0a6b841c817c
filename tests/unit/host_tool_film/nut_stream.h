// Streams in NUT's syntax (ffmpeg.org/~michael/nut.txt), written by hand. Checksums are 0: a pipe damages nothing.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace nodal::film {

using Bytes = std::vector<std::uint8_t>;

struct Nut {
  static constexpr std::uint64_t kMain = 0x4E4D7A561F5F04AD, kStream = 0x4E5311405BF2F9DB, kSync = 0x4E4BE4ADEECA4569,
                                 kInfo = 0x4E49AB68B596BA78;
  static constexpr int kShift = 7;  // times are written in 7 bits where they are near the one before
  /// Frame codes: the time and the size are written; the time is `kStep` later and the size 8; with the index of an
  /// elision header and the size written.
  static constexpr std::uint8_t kWritten = 1, kImplicit = 2, kElided = 3;
  static constexpr std::int64_t kStep = 3003;

  Bytes bytes;

  static void number(Bytes& to, std::uint64_t value) {
    for (int shift = 56; shift > 0; shift -= 7) {
      if (value >> shift != 0) to.push_back(static_cast<std::uint8_t>(0x80 | (value >> shift & 0x7F)));
    }
    to.push_back(static_cast<std::uint8_t>(value & 0x7F));
  }
  static void signed_number(Bytes& to, std::int64_t value) {
    number(to, value > 0 ? 2 * static_cast<std::uint64_t>(value) - 1 : static_cast<std::uint64_t>(-2 * value));
  }
  static void big_endian(Bytes& to, std::uint64_t value, int bytes) {
    for (int shift = 8 * bytes - 8; shift >= 0; shift -= 8) to.push_back(static_cast<std::uint8_t>(value >> shift));
  }
  static Bytes numbers(std::initializer_list<std::uint64_t> values) {
    Bytes made;
    for (const std::uint64_t value : values) number(made, value);
    return made;
  }

  void id() {
    constexpr std::string_view kId{"nut/multimedia container\0", 25};
    bytes.insert(bytes.end(), kId.begin(), kId.end());
  }
  void packet(std::uint64_t code, const Bytes& content) {
    big_endian(bytes, code, 8);
    number(bytes, content.size() + 4);
    if (content.size() + 4 > 4096) big_endian(bytes, 0, 4);
    bytes.insert(bytes.end(), content.begin(), content.end());
    big_endian(bytes, 0, 4);
  }
  /// Flags and fields of `count` frame codes. A picture's size is the written number times `multiplier`, plus `size`.
  static void frame_code(Bytes& to, std::uint64_t flags, std::int64_t step, std::uint64_t multiplier,
                         std::uint64_t size, std::uint64_t count) {
    number(to, flags);
    number(to, 6);
    signed_number(to, step);
    for (const std::uint64_t value : {multiplier, std::uint64_t{0}, size, std::uint64_t{0}, count}) number(to, value);
  }
  static Bytes frame_codes() {
    constexpr std::uint64_t kKey = 1, kCodedPts = 8, kSizeMsb = 32, kHeaderIndex = 1024, kInvalid = 8192;
    Bytes made;
    frame_code(made, kInvalid, 0, 1, 0, 1);
    frame_code(made, kKey | kCodedPts | kSizeMsb, 0, 1, 0, 1);
    frame_code(made, kKey, kStep, 9, 8, 1);
    frame_code(made, kKey | kCodedPts | kSizeMsb | kHeaderIndex, 0, 1, 0, 1);
    frame_code(made, kInvalid, 0, 1, 0, 251);  // the others, but for 'N'
    return made;
  }
  /// Time bases of 1/90000 and 1/1000 s, and an elision header of two bytes.
  static Bytes main_header() {
    Bytes made = numbers({3, 1, 65536, 2, 1, 90000, 1, 1000});
    const Bytes codes = frame_codes();
    made.insert(made.end(), codes.begin(), codes.end());
    for (const int byte : {1, 2, 0xEE, 0xDD}) made.push_back(static_cast<std::uint8_t>(byte));
    return made;
  }
  static Bytes stream_header(std::uint64_t width, std::uint64_t height) {
    return numbers({0, 0, 4, 'Y', '8', '0', '0', 0, kShift, 1000, 0, 0, 0, width, height, 1, 1, 0});
  }
  void headers(int width, int height) {
    id();
    packet(kMain, main_header());
    packet(kStream, stream_header(static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height)));
  }
  /// Times that follow count from `time` on, which is in units of 1/90000 s (base 0) or ms (base 1).
  void syncpoint(std::uint64_t time, std::uint64_t base) { packet(kSync, numbers({time * 2 + base, 0})); }
  /// The whole time is written.
  void frame(std::uint64_t time, const Bytes& picture) { coded(time + (1 << kShift), picture); }
  /// The last bits of the time are written.
  void near_frame(std::uint64_t time, const Bytes& picture) { coded(time & ((1 << kShift) - 1), picture); }
  void coded(std::uint64_t time, const Bytes& picture) {
    bytes.push_back(kWritten);
    number(bytes, time);
    number(bytes, picture.size());
    bytes.insert(bytes.end(), picture.begin(), picture.end());
  }
  void next_frame(const Bytes& picture) {
    bytes.push_back(kImplicit);
    bytes.insert(bytes.end(), picture.begin(), picture.end());
  }
};

}  // namespace nodal::film
