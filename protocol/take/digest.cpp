#include "protocol/take/digest.h"

#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "protocol/base/result.h"

namespace nodal::take {
namespace {

Xxh128 canonical(XXH128_hash_t hash) {
  XXH128_canonical_t bytes;
  XXH128_canonicalFromHash(&bytes, hash);
  Xxh128 out{};
  std::memcpy(out.data(), bytes.digest, out.size());
  return out;
}

}  // namespace

Xxh128 xxh128(std::span<const std::uint8_t> bytes) { return canonical(XXH3_128bits(bytes.data(), bytes.size())); }

std::string to_hex(const Xxh128& hash) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string hex;
  for (const std::uint8_t byte : hash) {
    hex += kDigits[byte >> 4];
    hex += kDigits[byte & 15];
  }
  return hex;
}

std::optional<Xxh128> xxh128_of_hex(std::string_view hex) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  Xxh128 hash{};
  if (hex.size() != 2 * hash.size()) return std::nullopt;
  for (std::size_t k = 0; k < hex.size(); ++k) {
    const std::size_t digit = kDigits.find(hex[k]);
    if (digit == std::string_view::npos) return std::nullopt;
    hash[k / 2] = static_cast<std::uint8_t>(hash[k / 2] << 4 | digit);
  }
  return hash;
}

PieceHashes::PieceHashes() : PieceHashes(std::vector<Xxh128>{}) {}

PieceHashes::PieceHashes(std::vector<Xxh128> whole)
    : state_(XXH3_createState()), complete_(std::move(whole)), bytes_(complete_.size() * kPiece) {
  NODAL_ASSERT(state_ != nullptr);
  XXH3_128bits_reset(state_.get());
}

void PieceHashes::Free::operator()(XXH3_state_s* state) const { XXH3_freeState(state); }

void PieceHashes::update(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const std::uint64_t room = kPiece - bytes_ % kPiece;
    const auto now = bytes.first(static_cast<std::size_t>(std::min<std::uint64_t>(room, bytes.size())));
    XXH3_128bits_update(state_.get(), now.data(), now.size());
    bytes_ += now.size();
    bytes = bytes.subspan(now.size());
    if (bytes_ % kPiece != 0) continue;
    complete_.push_back(canonical(XXH3_128bits_digest(state_.get())));
    XXH3_128bits_reset(state_.get());
  }
}

std::vector<Xxh128> PieceHashes::all() const {
  std::vector<Xxh128> pieces = complete_;
  if (bytes_ % kPiece != 0) pieces.push_back(canonical(XXH3_128bits_digest(state_.get())));
  return pieces;
}

Xxh128 digest_of(std::span<const Xxh128> pieces) {
  std::vector<std::uint8_t> bytes;
  for (const Xxh128& piece : pieces) bytes.insert(bytes.end(), piece.begin(), piece.end());
  return xxh128(bytes);
}

}  // namespace nodal::take
