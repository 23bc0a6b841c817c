// Compares the pulses that were written with those that a second line measures at the board's output.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "hal/trigger.h"

namespace nodal::hal::gpio {

/// A pulse is reported with the kernel's timestamp of its edge at the read-back line, and not at all when there is none
/// within half a period: the line is cut, shorted, or driven by something else.
///
/// Threading: thread-bound.
/// Errors: none.
class ReadBack {
 public:
  void start(Duration period);
  /// A pulse that was written; then, in any order against the pulses, an edge of the read-back line.
  void add_pulse(const TriggerEdge& pulse);
  void add_edge(Instant at);
  /// The next pulse that was seen. `now` ends the wait for those that were not.
  std::optional<TriggerEdge> take(Instant now);
  std::uint64_t unseen() const { return unseen_; }  ///< pulses without an edge
  std::uint64_t extra() const { return extra_; }    ///< edges without a pulse

 private:
  static constexpr std::size_t kKept = 64;
  template <class T>
  struct Queue {
    std::array<T, kKept> places{};
    std::size_t first = 0, size = 0;
    T& front() { return places[first]; }
    void pop() {
      first = (first + 1) % kKept;
      --size;
    }
    /// False when the oldest had to go.
    bool push(const T& value) {
      const bool room = size < kKept;
      if (!room) pop();
      places[(first + size++) % kKept] = value;
      return room;
    }
  };

  Duration reach_;
  Queue<TriggerEdge> pulses_;
  Queue<Instant> edges_;
  std::uint64_t unseen_ = 0;
  std::uint64_t extra_ = 0;
};

}  // namespace nodal::hal::gpio
