// The true data, written into every picture: however the rig handles a frame, its pixels identify the exposure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include "protocol/base/image.h"
#include "protocol/base/units.h"

namespace nodal::swarm {

/// Heads' pictures: of one grey level in any format, just large enough for a stamp and a few pixels to blend.
inline constexpr int kPictureWidth = 16;
inline constexpr int kPictureHeight = 16;
inline constexpr int kStampRows = 4;     ///< below them the level is kPictureLevel
inline constexpr int kFirstBlended = 8;  ///< first row with rays: a field's rows also reach upwards
inline constexpr std::uint8_t kPictureLevel = 100;

/// Identifies a pulse: the start of the trigger, and the number since that start. Unset for exposures without a pulse.
struct PulseId {
  std::uint32_t epoch = 0;  ///< 0: none
  std::uint64_t number = 0;
  friend bool operator==(const PulseId&, const PulseId&) = default;
};

struct Stamp {
  std::uint32_t mark = kMark;
  std::uint32_t head = 0;
  std::uint64_t serial = 0;  ///< the head's exposures since the world began; never restarts or wraps
  PulseId pulse;
  Instant begin;
  Instant mid;
  std::uint64_t proof = 0;

  static constexpr std::uint32_t kMark = 0x6e6f6461;
  std::uint64_t expected_proof() const {
    std::uint64_t all = mark;
    for (const std::uint64_t part : {std::uint64_t{head}, serial, std::uint64_t{pulse.epoch}, pulse.number,
                                     static_cast<std::uint64_t>(begin.ns()), static_cast<std::uint64_t>(mid.ns())}) {
      all = (all ^ part) * 0x9E3779B97F4A7C15ULL;
      all ^= all >> 29;
    }
    return all;
  }
  void write(const MutableImageView& picture) {
    proof = expected_proof();
    std::array<std::uint8_t, sizeof(Stamp)> bytes;
    std::memcpy(bytes.data(), this, sizeof *this);
    for (std::size_t i = 0; i < bytes.size(); ++i) picture.planes[0].data[place(picture, i)] = bytes[i];
  }
  /// Nothing if the picture was overwritten, or is not a stamped one.
  static std::optional<Stamp> read(const ImageView& picture) {
    std::array<std::uint8_t, sizeof(Stamp)> bytes;
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = picture.planes[0].data[place(picture, i)];
    Stamp stamp;
    std::memcpy(static_cast<void*>(&stamp), bytes.data(), sizeof stamp);
    if (stamp.mark != kMark || stamp.proof != stamp.expected_proof()) return std::nullopt;
    return stamp;
  }

 private:
  /// Where byte i is in plane 0: in the samples of Y or grey, of a JPEG in its comment, which is its first segment.
  template <class Byte>
  static std::ptrdiff_t place(const BasicImageView<Byte>& picture, std::size_t i) {
    constexpr std::ptrdiff_t kJpegComment = 6;
    const auto at = static_cast<std::ptrdiff_t>(i);
    if (picture.format == PixelFormat::kMjpeg) return kJpegComment + at;
    if (picture.format == PixelFormat::kYuv411) return at;
    return at / kPictureWidth * picture.planes[0].row_stride + at % kPictureWidth * picture.planes[0].pixel_stride;
  }
};
static_assert(sizeof(Stamp) <= kPictureWidth * kStampRows);

}  // namespace nodal::swarm
