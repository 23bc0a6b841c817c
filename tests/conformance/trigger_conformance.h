// The tests that every TriggerPort must pass. To add an implementation: add a TriggerWorld.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "hal/trigger.h"

namespace nodal::hal {

class TriggerWorld {
 public:
  virtual ~TriggerWorld() = default;
  virtual TriggerPort& trigger() = 0;
  virtual void pass(Duration time) = 0;
  /// The longest pause that pass() can simulate in this world.
  virtual Duration longest_pause() const { return Duration::seconds(10LL * 365 * 86'400); }
  /// The largest deviation of a pulse from the grid, in both directions.
  virtual Duration jitter() const { return {}; }
};

struct TriggerWorldKind {
  std::string name;
  std::function<std::unique_ptr<TriggerWorld>()> make;
  friend std::ostream& operator<<(std::ostream& out, const TriggerWorldKind& kind) { return out << kind.name; }
};

class TriggerConformance : public testing::TestWithParam<TriggerWorldKind> {
 protected:
  TriggerPort& trigger() { return world_->trigger(); }
  std::vector<TriggerEdge> edges() {
    std::vector<TriggerEdge> all;
    while (auto edge = trigger().take_edge().value()) all.push_back(*edge);
    return all;
  }
  /// Lets time pass in small steps, like a daemon, and takes the edges.
  std::vector<TriggerEdge> edges_during(Duration time) {
    std::vector<TriggerEdge> all;
    for (int i = 0; i < 100; ++i) {
      world_->pass(time / 100);
      for (const TriggerEdge& edge : edges()) all.push_back(edge);
    }
    return all;
  }

  std::unique_ptr<TriggerWorld> world_ = GetParam().make();
};

}  // namespace nodal::hal
