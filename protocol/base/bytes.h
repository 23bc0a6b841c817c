// Reads and writes little-endian numbers, on any machine. Neither class touches memory outside its span: an access
// past the end fails, and all later ones fail too, so a parser can read all its fields and check ok() once at the
// end.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace nodal {

/// Reads numbers from bytes that it does not own. After a read past the end every read returns zeros.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  std::uint8_t u8() { return number<std::uint8_t>(); }
  std::uint16_t u16() { return number<std::uint16_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  std::uint64_t u64() { return number<std::uint64_t>(); }

  /// The next `n` bytes, not copied; empty, and ok() becomes false, when fewer are left.
  std::span<const std::uint8_t> bytes(std::size_t n) {
    if (n > rest_.size()) {
      fail();
      return {};
    }
    const auto taken = rest_.first(n);
    rest_ = rest_.subspan(n);
    return taken;
  }
  /// All bytes that are not yet read.
  std::span<const std::uint8_t> rest() { return bytes(rest_.size()); }

  std::size_t left() const { return rest_.size(); }
  /// False after a read past the end.
  bool ok() const { return ok_; }
  /// Whether every read succeeded and no byte is left.
  bool complete() const { return ok_ && rest_.empty(); }

 private:
  template <std::unsigned_integral T>
  T number() {
    const auto from = bytes(sizeof(T));
    T value = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      value = static_cast<T>(value | static_cast<T>(static_cast<T>(from[i]) << (8 * i)));
    }
    return value;
  }
  void fail() {
    ok_ = false;
    rest_ = {};
  }

  std::span<const std::uint8_t> rest_;
  bool ok_ = true;
};

/// Writes numbers into bytes that it does not own. A number that does not fit is not written, and ok() is false.
class ByteWriter {
 public:
  explicit ByteWriter(std::span<std::uint8_t> into) : into_(into) {}

  void u8(std::uint8_t value) { number(value); }
  void u16(std::uint16_t value) { number(value); }
  void u32(std::uint32_t value) { number(value); }
  void u64(std::uint64_t value) { number(value); }

  void bytes(std::span<const std::uint8_t> from) {
    if (!ok_ || from.size() > into_.size() - used_) {
      ok_ = false;
      return;
    }
    if (!from.empty()) std::memcpy(into_.data() + used_, from.data(), from.size());
    used_ += from.size();
  }

  /// Bytes written so far.
  std::size_t size() const { return used_; }
  bool ok() const { return ok_; }

 private:
  template <std::unsigned_integral T>
  void number(T value) {
    std::uint8_t little[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) little[i] = static_cast<std::uint8_t>(value >> (8 * i));
    bytes(little);
  }

  std::span<std::uint8_t> into_;
  std::size_t used_ = 0;
  bool ok_ = true;
};

}  // namespace nodal
