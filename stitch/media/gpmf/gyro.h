// The gyro in GoPro's telemetry (GPMF: keys, lengths and values, big-endian).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::media {

/// What one sample of a film's GPMF track says of the gyro.
struct GyroSamples {
  std::vector<std::array<double, 3>> rates{};  ///< rad/s, axes in the file's order
  std::optional<std::uint32_t> total{};        ///< TSMP: samples up to the end of this payload, if it is there
};

/// Reads the first stream with GYRO. Everything else is passed over.
///
/// Errors: kMissingField without GYRO; kTruncated, kBadFormat, kBadValue and kUnsupported name the key.
///
/// Threading: thread-safe.
Result<GyroSamples> read_gyro(std::span<const std::uint8_t> payload);

/// A sample of a film's GPMF track.
struct TimedPayload {
  double time = 0;      ///< s, by the film's clock
  double duration = 0;  ///< s
  std::span<const std::uint8_t> bytes{};
};

/// The gyro of a film.
struct Gyro {
  std::vector<double> times{};   ///< s, by the film's clock, increasing
  std::vector<double> speeds{};  ///< length of the rate of rotation, rad/s
};

/// The gyro of a film's payloads in their order. GPMF has no time for each sample; a straight line through the
/// payloads' times, against the number of samples before each, gives the times. A payload without GYRO is passed over
/// if the others count their samples (TSMP).
Result<Gyro> read_gyro(std::span<const TimedPayload> payloads);

}  // namespace nodal::media
