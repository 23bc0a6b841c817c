// Limits of what a take's documents and evidence say. Whoever writes them keeps to these, and whoever reads them
// accepts no more.
#pragma once

#include <cstddef>
#include <cstdint>

namespace nodal::take {

/// Numbers of takes are counted up by one, so a rig does not come this far.
inline constexpr std::uint64_t kMaxTakeNumber = std::uint64_t{1} << 40;
/// Sets of a take: recorded, lost, deleted. 60 a second for 148 000 years.
inline constexpr std::uint64_t kMaxSets = std::uint64_t{1} << 48;
/// Times and lengths, ns: 73 years, so that sums of two fit 64 bits.
inline constexpr std::int64_t kMaxTimeNs = INT64_MAX / 4;
/// UTC, ns since 1970: until 2116.
inline constexpr std::int64_t kMaxUtcNs = INT64_MAX / 2;
/// A name or a sentence in a document.
inline constexpr std::size_t kMaxTakeTextBytes = 256;
/// Rates that a manifest lists; later changes are in the evidence only.
inline constexpr std::size_t kMaxRates = 1'000;
inline constexpr std::uint32_t kMaxSegments = 1U << 24;
/// A picture as it is stored: 50 MB are 8192x4096 px in I420.
inline constexpr std::uint64_t kMaxTakePictureBytes = std::uint64_t{64} << 20;
inline constexpr std::uint32_t kMaxTakePictureSide = 65'535;  ///< px

}  // namespace nodal::take
