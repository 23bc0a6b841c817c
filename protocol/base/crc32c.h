// CRC32C (Castagnoli; RFC 3720 B.4, RFC 3385): detects torn and corrupted bytes on links and in files.
#pragma once

#include <cstdint>
#include <span>

namespace nodal {

/// The CRC of `bytes`, or, with `previous`, of the bytes that `previous` covers followed by `bytes`. Uses the
/// processor's CRC instruction if there is one.
std::uint32_t crc32c(std::span<const std::uint8_t> bytes, std::uint32_t previous = 0);

/// The same by a lookup table, on any processor: the specification of crc32c().
std::uint32_t crc32c_by_table(std::span<const std::uint8_t> bytes, std::uint32_t previous = 0);

}  // namespace nodal
