// A second reader of everything, beside the blend and the publisher: it keeps pace, is slow, or is stuck.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "firmware/frame/outlet.h"
#include "firmware/rig.h"
#include "hal/sim/scene/random.h"

namespace nodal::swarm {

/// What a seed draws of it.
struct ReaderNature {
  firmware::OutletSpec sets, raymaps;
};
ReaderNature draw_reader(hal::sim::Random& random);

/// Holds loans of raymaps as long as its pace says, of frame sets at most kSetHeld, and never more of either than its
/// outlets' specs allow.
///
/// Threading: thread-bound.
/// Ownership: holds loans; destroy it before the rig.
/// Errors: step() says what does not hold.
class SecondReader {
 public:
  /// Registers at a rig that has not been stepped yet.
  SecondReader(firmware::Rig& rig, const ReaderNature& nature, std::uint64_t seed);

  /// Reads and gives back. What is wrong, if anything: an item out of order, one that is neither read nor counted as
  /// missed nor waiting, or one that the publisher missed or waits for.
  std::optional<std::string> step(Instant now);

  /// As readers of sets must (outlet.h).
  static constexpr Duration kSetHeld = Duration::milliseconds(200);

 private:
  enum class Pace : std::uint8_t { kKeepsUp, kSlow, kStuck };
  template <class Item>
  struct Reading {
    firmware::Outlet<Item>* outlet = nullptr;
    std::deque<Item> held{};
    std::uint64_t read = 0;
    std::optional<std::uint64_t> newest{};  ///< the number of the item read last
  };

  void change_pace(Instant now);
  template <class Item, class NumberOf>
  std::optional<std::string> read(Reading<Item>& from, Pace pace, std::uint64_t offered, NumberOf number_of);

  firmware::Rig& rig_;
  hal::sim::Random random_;
  Reading<firmware::SetLoan> sets_;
  Reading<firmware::Raymap> raymaps_;
  Pace pace_ = Pace::kKeepsUp;
  Instant pace_until_;
  Instant next_set_, next_raymap_;  ///< when they are read
};

}  // namespace nodal::swarm
