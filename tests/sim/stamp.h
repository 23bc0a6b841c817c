// The true data, written into every picture: however the rig handles a frame, its pixels identify the exposure.
#pragma once

#include <cstdint>
#include <cstring>
#include <optional>

#include "protocol/base/units.h"

namespace nodal::swarm {

/// Heads' pictures: GREY, just large enough for a stamp and a few pixels to blend.
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
  void write(std::uint8_t* picture) {
    proof = expected_proof();
    std::memcpy(picture, this, sizeof *this);
  }
  /// Nothing if the picture was overwritten, or is not a stamped one.
  static std::optional<Stamp> read(const std::uint8_t* picture) {
    Stamp stamp;
    std::memcpy(static_cast<void*>(&stamp), picture, sizeof stamp);
    if (stamp.mark != kMark || stamp.proof != stamp.expected_proof()) return std::nullopt;
    return stamp;
  }
};
static_assert(sizeof(Stamp) <= kPictureWidth * kStampRows);

}  // namespace nodal::swarm
