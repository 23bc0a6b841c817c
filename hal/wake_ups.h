#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal {

/// What ends the sleep of a thread that found no work at its ports: descriptors of the kernel, and a time of the rig's
/// clock. Every port adds its own, and the thread then sleeps for all of them at once.
class WakeUps {
 public:
  /// Room for the heads and the trigger, or for the hosts' links and their listeners.
  static constexpr std::size_t kMax = 64;
  struct Descriptor {
    int number = -1;
    bool readable = false;                 ///< wakes when there is something to read
    bool writable = false;                 ///< wakes when there is room to write
    std::optional<bool>* ready = nullptr;  ///< if given, a wait that polls sets it to whether the descriptor woke it
  };

  /// The earliest of all times counts.
  void at(Instant when) {
    if (!at_ || when < *at_) at_ = when;
  }
  /// A descriptor that waits for neither is left out: the kernel would report its errors without end.
  void on(const Descriptor& descriptor) {
    if (descriptor.number < 0 || !(descriptor.readable || descriptor.writable)) return;
    NODAL_ASSERT(count_ < kMax);
    descriptors_[count_++] = descriptor;
  }

  std::optional<Instant> at() const { return at_; }
  std::span<const Descriptor> descriptors() const { return std::span(descriptors_).first(count_); }

 private:
  std::array<Descriptor, kMax> descriptors_{};
  std::size_t count_ = 0;
  std::optional<Instant> at_;
};

}  // namespace nodal::hal
