// Which takes hosts are reading, for those that delete takes.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace nodal::firmware {

/// Control notes the takes that hosts read; the disk's stage deletes none of them to make room. The reader of takes
/// says when it has a file open, so that an eject waits for it.
///
/// Threading: set() is thread-bound to control, begin_read() and end_read() to the reader, set_ejected() and is_read()
///   to the disk's stage; contains() is for any thread.
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

  /// False: the disk was ejected, so nothing may be opened. Else call end_read() when the file is closed.
  bool begin_read() {
    reading_.store(true);
    if (!ejected_.load()) return true;
    reading_.store(false);
    return false;
  }
  void end_read() { reading_.store(false); }
  /// While it is set, no read begins.
  void set_ejected(bool on) { ejected_.store(on); }
  /// A file may still be open.
  bool is_read() const { return reading_.load(); }

 private:
  std::array<std::atomic<std::uint64_t>, kMaxReaders> takes_{};
  std::atomic<bool> reading_{false};
  std::atomic<bool> ejected_{false};
};

}  // namespace nodal::firmware
