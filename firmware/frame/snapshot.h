#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace nodal::firmware {

/// The newest state of one stage, for one reading stage (a triple buffer). Neither side waits: of the three copies one
/// is being written, one is being read, and one is exchanged between the two sides.
///
/// Threading: publish() by one thread, read() by one other.
/// Ownership: owns the copies; the reference that read() returns is valid until the next read().
/// Errors: none.
template <class T>
class Snapshot {
 public:
  void publish(const T& value) {
    copies_[writing_] = value;  // assigned to an old copy, so that its strings and vectors reuse their memory
    writing_ = offered_.exchange(static_cast<std::uint8_t>(writing_ | kFresh), std::memory_order_acq_rel) & kIndex;
  }
  const T& read() {
    if ((offered_.load(std::memory_order_relaxed) & kFresh) != 0) {
      reading_ = offered_.exchange(reading_, std::memory_order_acq_rel) & kIndex;
    }
    return copies_[reading_];
  }

 private:
  static constexpr std::uint8_t kFresh = 4;
  static constexpr std::uint8_t kIndex = 3;

  std::array<T, 3> copies_{};
  std::uint8_t writing_ = 0;
  std::atomic<std::uint8_t> offered_{1};
  std::uint8_t reading_ = 2;
};

}  // namespace nodal::firmware
