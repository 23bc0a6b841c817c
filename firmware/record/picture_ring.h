// Memory for pictures on their way to the disk.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace nodal::firmware {

/// Hands out contiguous pieces in order, and takes them back in order. Allocates nothing after construction.
///
/// Threading: take(), shrink() and taken() by one thread, release() by one other, used() by any.
/// Ownership: owns the memory.
/// Errors: take() returns nothing if there is not enough free memory in one piece.
class PictureRing {
 public:
  explicit PictureRing(std::size_t bytes) : memory_(bytes) {}

  std::optional<std::span<std::uint8_t>> take(std::size_t bytes) {
    std::uint64_t begin = taken_.load(std::memory_order_relaxed);
    const std::uint64_t size = memory_.size();
    if (bytes > size) return std::nullopt;
    if (begin % size + bytes > size) begin += size - begin % size;  // the rest at the end is too short
    if (begin + bytes - released_.load(std::memory_order_acquire) > size) return std::nullopt;
    taken_.store(begin + bytes, std::memory_order_relaxed);
    return std::span(memory_).subspan(static_cast<std::size_t>(begin % size), bytes);
  }
  /// Everything taken so far lies before it.
  std::uint64_t taken() const { return taken_.load(std::memory_order_relaxed); }
  /// Gives back what was taken after a call of taken() that returned `position`.
  void give_back(std::uint64_t position) { taken_.store(position, std::memory_order_relaxed); }
  /// Releases everything that lies before `position`.
  void release(std::uint64_t position) { released_.store(position, std::memory_order_release); }
  std::size_t used() const {
    return static_cast<std::size_t>(taken_.load(std::memory_order_relaxed) - released_.load(std::memory_order_acquire));
  }
  std::size_t size() const { return memory_.size(); }

 private:
  std::vector<std::uint8_t> memory_;
  // Count bytes since the start, the skipped ones at the end of the memory included; they never wrap.
  std::atomic<std::uint64_t> taken_{0};
  std::atomic<std::uint64_t> released_{0};
};

}  // namespace nodal::firmware
