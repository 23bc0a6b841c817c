// CRC32C (Castagnoli; RFC 3720 B.4, RFC 3385): finds torn and flipped bytes on links and in files.
#pragma once

#include <cstdint>
#include <span>

namespace nodal {

/// The CRC of `bytes`, or of what `previous` covered followed by `bytes`.
/// With the processor's own instruction where it has one.
std::uint32_t crc32c(std::span<const std::uint8_t> bytes, std::uint32_t previous = 0);

/// The same by table, on any processor: the specification of the above.
std::uint32_t crc32c_by_table(std::span<const std::uint8_t> bytes, std::uint32_t previous = 0);

}  // namespace nodal
