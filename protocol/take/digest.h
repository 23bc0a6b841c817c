// Hashes of the files of a take.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

struct XXH3_state_s;

namespace nodal::take {

/// XXH3-128 in its canonical order of bytes (xxHash 0.8).
using Xxh128 = std::array<std::uint8_t, 16>;

Xxh128 xxh128(std::span<const std::uint8_t> bytes);
/// 32 lower-case hexadecimal digits, and back.
std::string to_hex(const Xxh128& hash);
std::optional<Xxh128> xxh128_of_hex(std::string_view hex);

/// Hashes a file in pieces of one MiB; the last one may be shorter. The first piece is hashed by the caller when the
/// file is finished, because a sector of it is written again at the end.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class PieceHashes {
 public:
  static constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;

  PieceHashes();
  /// Goes on after `whole` pieces that were hashed before.
  explicit PieceHashes(std::vector<Xxh128> whole);
  void update(std::span<const std::uint8_t> bytes);
  std::uint64_t bytes() const { return bytes_; }
  /// Hashes of the complete pieces.
  const std::vector<Xxh128>& complete() const { return complete_; }
  /// Hashes of all pieces, the incomplete one at the end included.
  std::vector<Xxh128> all() const;

 private:
  struct Free {
    void operator()(XXH3_state_s* state) const;
  };
  std::unique_ptr<XXH3_state_s, Free> state_;
  std::vector<Xxh128> complete_;
  std::uint64_t bytes_ = 0;
};

/// What a manifest says about a file: the XXH3-128 of the hashes of its pieces.
Xxh128 digest_of(std::span<const Xxh128> pieces);

}  // namespace nodal::take
