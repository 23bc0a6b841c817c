// Elements of EBML (RFC 8794): an id, a length, a content.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace nodal::take {

using Bytes = std::vector<std::uint8_t>;

/// The id's bytes as they are in the file, such as 0x1A45DFA3.
using ElementId = std::uint32_t;

inline void put_big_endian(Bytes& out, std::uint64_t value, int bytes) {
  for (int k = bytes - 1; k >= 0; --k) out.push_back(static_cast<std::uint8_t>(value >> (8 * k)));
}

inline void put_id(Bytes& out, ElementId id) {
  put_big_endian(out, id, static_cast<int>((std::bit_width(id) + 7) / 8));
}

/// A length in eight bytes. 2^56 - 1 is the length "unknown"; lengths are far below it.
inline void put_length(Bytes& out, std::uint64_t length) { put_big_endian(out, length | std::uint64_t{1} << 56, 8); }
inline constexpr std::uint64_t kUnknownLength = (std::uint64_t{1} << 56) - 1;

/// In as few bytes as possible; a length of all ones means "unknown", so that value takes one byte more.
inline void put_short_length(Bytes& out, std::uint64_t length) {
  int bytes = 1;
  while (length >= (std::uint64_t{1} << (7 * bytes)) - 1) ++bytes;
  put_big_endian(out, length | std::uint64_t{1} << (7 * bytes), bytes);
}

inline void put_element(Bytes& out, ElementId id, std::span<const std::uint8_t> content) {
  put_id(out, id);
  put_short_length(out, content.size());
  out.insert(out.end(), content.begin(), content.end());
}

inline void put_number(Bytes& out, ElementId id, std::uint64_t value) {
  put_id(out, id);
  const int bytes = value == 0 ? 1 : static_cast<int>((std::bit_width(value) + 7) / 8);
  put_short_length(out, static_cast<std::uint64_t>(bytes));
  put_big_endian(out, value, bytes);
}

inline void put_float(Bytes& out, ElementId id, double value) {
  put_id(out, id);
  put_short_length(out, 8);
  put_big_endian(out, std::bit_cast<std::uint64_t>(value), 8);
}

inline void put_text(Bytes& out, ElementId id, std::string_view text) {
  put_element(out, id, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

/// Fills `out` up to `size` with an element that readers skip. `size` is at least 9 bytes more than it has.
inline void pad_to(Bytes& out, std::size_t size) {
  out.push_back(0xEC);
  put_length(out, size - out.size() - 8);
  out.resize(size);
}

}  // namespace nodal::take
