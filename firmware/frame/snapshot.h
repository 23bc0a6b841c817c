#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace nodal::firmware {

/// The newest state of one stage, for one other to look at. Neither ever waits: there are three copies, one being
/// written, one being read, and one to exchange with.
///
/// Threading: publish() by one thread, read() by one other.
/// Ownership: owns the copies; what read() gave is valid until the next read().
/// Errors: none.
template <class T>
class Snapshot {
 public:
  void publish(const T& value) {
    copies_[writing_] = value;  // over an old copy, so that its strings and vectors keep their memory
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
