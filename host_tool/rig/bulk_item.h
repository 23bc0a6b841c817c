// Assembles one item of a stream from its pieces.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/bulk.h"

namespace nodal::host {

/// Memory grows with the received bytes (to at most twice as much), not with the length that the rig announces.
///
/// Threading: thread-bound.
/// Ownership: owns the bytes until take().
/// Errors: kTooLarge.
class BulkItemBytes {
 public:
  /// Begins an item of at most `limit` bytes; `what` names it in errors.
  Status begin(const BulkPiece& first, std::uint64_t limit, std::string_view what);
  void add(const BulkPiece& piece);
  std::size_t size() const { return bytes_.size(); }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }
  /// The item so far. Valid until the next call; begin() then uses the same memory again.
  std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  std::uint64_t total_ = 0;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace nodal::host
