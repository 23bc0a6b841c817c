// A second reader of raymaps beside the publisher: in step, slow, or stuck.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "firmware/frame/outlet.h"
#include "firmware/rig.h"
#include "hal/sim/scene/random.h"

namespace nodal::swarm {

/// Draws its parameters from a seed.
firmware::OutletSpec draw_reader(hal::sim::Random& random);

/// Holds loans of raymaps according to its pace, never more than its outlet's spec allows.
///
/// Threading: thread-bound.
/// Ownership: holds loans; destroy it before the rig.
/// Errors: step() returns a broken rule.
class SecondReader {
 public:
  /// Registers with a rig that has not been stepped yet.
  SecondReader(firmware::Rig& rig, const firmware::OutletSpec& spec, std::uint64_t seed);

  /// Reads raymaps and returns their loans. Returns the broken rule, if any: a raymap out of order, one that is neither
  /// read nor counted as missed nor waiting, or one that the publisher missed or waits for.
  std::optional<std::string> step(Instant now);

 private:
  enum class Pace : std::uint8_t { kKeepsUp, kSlow, kStuck };

  void change_pace(Instant now);
  std::optional<std::string> read();

  firmware::Rig& rig_;
  hal::sim::Random random_;
  firmware::Outlet<firmware::Raymap>& outlet_;
  std::deque<firmware::Raymap> held_;
  std::uint64_t read_ = 0;
  /// Twice the set of the newest raymap that was read, plus 1 if from the second field.
  std::optional<std::uint64_t> newest_;
  Pace pace_ = Pace::kKeepsUp;
  Instant pace_until_;
  Instant next_read_;
};

}  // namespace nodal::swarm
