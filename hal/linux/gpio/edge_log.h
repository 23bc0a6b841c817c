// Pulses from the thread that sends them to capture's thread, without a lock.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "hal/trigger.h"

namespace nodal::hal::gpio {

/// Keeps the newest kKept pulses: unlike SpscRing, a full log overwrites the oldest one, because capture needs the
/// newest.
///
/// Threading: add() from one thread, take() from one other. All accesses are sequentially consistent; each place has a
/// count that is 0 while it is written, so a reader detects a place that is overwritten under it.
class EdgeLog {
 public:
  static constexpr std::size_t kKept = 256;  ///< eight seconds of NTSC

  /// `train` tells pulses of one start() from those of the next.
  void add(std::uint32_t train, const TriggerEdge& edge) {
    const std::uint64_t count = written_.load();
    Place& place = places_[count % kKept];
    place.count.store(0);
    place.train.store(train);
    place.number.store(edge.number);
    place.at_ns.store(edge.at.ns());
    place.count.store(count + 1);
    written_.store(count + 1);
  }

  /// The oldest edge of `train` that is still kept and was not taken; edges of other trains are skipped.
  std::optional<TriggerEdge> take(std::uint32_t train) {
    for (;;) {
      const std::uint64_t written = written_.load();
      if (read_ == written) return std::nullopt;
      if (written - read_ > kKept) {
        forgotten_ += written - kKept - read_;
        read_ = written - kKept;
      }
      const Place& place = places_[read_ % kKept];
      const std::uint64_t before = place.count.load();
      const std::uint32_t of = place.train.load();
      const TriggerEdge edge{place.number.load(), Instant::from_ns(place.at_ns.load())};
      const bool whole = before == read_ + 1 && place.count.load() == before;
      ++read_;
      if (!whole) ++forgotten_;
      else if (of == train) return edge;
    }
  }

  std::uint64_t forgotten() const { return forgotten_; }  ///< overwritten before they were taken

 private:
  struct Place {
    std::atomic<std::uint64_t> count{0};
    std::atomic<std::uint32_t> train{0};
    std::atomic<std::uint64_t> number{0};
    std::atomic<std::int64_t> at_ns{0};
  };
  std::array<Place, kKept> places_;
  std::atomic<std::uint64_t> written_{0};
  std::uint64_t read_ = 0;  ///< the reader's
  std::uint64_t forgotten_ = 0;
};

}  // namespace nodal::hal::gpio
