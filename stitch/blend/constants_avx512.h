// The constants of the AVX-512 kernel, in the form in which it loads them. Internal to blend_avx512.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace nodal::blend {
namespace {

/// Kept in memory on purpose: otherwise the compiler rebuilds each constant for every tile from one number, with a
/// shuffle each. As a memory operand of an instruction a constant costs nothing.
struct Constants {
  using Shorts = std::array<std::int16_t, 32>;
  using Bytes = std::array<std::uint8_t, 64>;
  alignas(64) Shorts j, jj, next;   ///< factors of the upper rows, by lane: j, jj, 8j + 16
  alignas(64) Bytes pair_of;        ///< added to a byte index in both bytes of a number: it and its successor
  alignas(64) Bytes nibble, seven;  ///< bit positions for twice_from: bits 12 .. 15, and 5 .. 12
  alignas(64) Bytes tops;           ///< picks the high byte of each number, twice
  alignas(64) Bytes order;          ///< reorders rows of 64 bits from 0 4 1 5 2 6 3 7 to 0 .. 7
  alignas(64) Shorts upper_nibbles, low_bits, flips, across, share, row, half_level;
  alignas(32) std::array<std::int16_t, 16> i, ii;
  alignas(32) std::array<std::uint8_t, 32> term[6];  ///< picks coefficient k in both halves
  alignas(
      32) std::array<std::uint8_t, 32> pair[2];  ///< picks coefficient k for the lower half, and k + 2 for the upper
};
constexpr Constants constants() {
  Constants c{};
  for (std::size_t k = 0; k < 32; ++k) {
    const auto lane = static_cast<std::int16_t>(k / 8);
    c.j[k] = lane;
    c.jj[k] = static_cast<std::int16_t>(lane * lane);
    c.next[k] = static_cast<std::int16_t>(8 * lane + 16);
    c.upper_nibbles[k] = static_cast<std::int16_t>(0xf0f0);
    c.low_bits[k] = 0x7f7f;
    c.flips[k] = static_cast<std::int16_t>(0xff00);
    c.across[k] = 0x0180;
    c.share[k] = 0x7ff8;
    c.row[k] = 0x1010;
    c.half_level[k] = 64;
  }
  for (std::size_t k = 0; k < 64; ++k) {
    const std::size_t word = k % 8 / 2 * 16;
    c.nibble[k] = static_cast<std::uint8_t>(word + 12);
    c.seven[k] = static_cast<std::uint8_t>(word + 5);
    c.tops[k] = static_cast<std::uint8_t>(k % 16 | 1);
    c.order[k] = static_cast<std::uint8_t>(k % 8 == 0 ? k / 32 + k / 8 % 4 * 2 : 0);
    c.pair_of[k] = static_cast<std::uint8_t>(k % 2);
  }
  for (std::size_t k = 0; k < 16; ++k) {
    c.i[k] = static_cast<std::int16_t>(k % 8);
    c.ii[k] = static_cast<std::int16_t>(k % 8 * (k % 8));
  }
  for (std::size_t k = 0; k < 32; ++k) {
    for (std::size_t t = 0; t < 6; ++t) c.term[t][k] = static_cast<std::uint8_t>(2 * t + k % 2);
    for (std::size_t t = 0; t < 2; ++t) c.pair[t][k] = static_cast<std::uint8_t>(2 * t + k / 16 * 4 + k % 2);
  }
  return c;
}

}  // namespace
}  // namespace nodal::blend
