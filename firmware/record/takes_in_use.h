// Which takes hosts are reading, for those that delete takes.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>

namespace nodal::firmware {

/// Control notes the takes that hosts read; the disk's stage deletes none of them to make room. The reader of takes and an eject
/// exclude each other by the mutex.
///
/// Threading: set() is thread-bound to control, the rest is for any thread.
/// Errors: none.
class TakesInUse {
 public:
  static constexpr std::size_t kMaxReaders = 64;

  /// `take` 0: this reader reads none.
  void set(std::size_t reader, std::uint64_t take) { takes_.at(reader).store(take, std::memory_order_relaxed); }
  bool contains(std::uint64_t take) const {
    for (const auto& each : takes_) {
      if (each.load(std::memory_order_relaxed) == take) return true;
    }
    return false;
  }

  /// Held by the reader of takes while it has a file open.
  std::mutex& reading() { return reading_; }
  /// While it is set, takes are not read. Call with reading() held.
  void set_ejected(bool on) { ejected_ = on; }
  /// Call with reading() held.
  bool ejected() const { return ejected_; }

 private:
  std::array<std::atomic<std::uint64_t>, kMaxReaders> takes_{};
  std::mutex reading_;
  bool ejected_ = false;
};

}  // namespace nodal::firmware
