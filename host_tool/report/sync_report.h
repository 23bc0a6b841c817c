// How simultaneous a rig's exposures are over many sets, from the timing data of each set.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/console/console.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

/// Statistics of durations, ns. Percentiles use the nearest rank: the smallest value with that share at or below it.
struct SyncFigures {
  std::int64_t median_ns = 0;
  std::int64_t p99_ns = 0;
  std::int64_t worst_ns = 0;
  static SyncFigures of(std::vector<std::int64_t> values);
};

/// Threading: thread-bound.
/// Ownership: keeps the timing data of each set.
/// Errors: none.
class SyncReport {
 public:
  explicit SyncReport(std::vector<std::string> head_names) : names_(std::move(head_names)) {}

  void add(const wire::RaymapHeader& set);
  /// Sets that the rig dropped because this end was too slow.
  void set_dropped(std::uint64_t dropped) { dropped_ = dropped; }
  std::size_t sets() const { return sets_.size(); }

  struct Head {
    std::string name;
    std::uint64_t missing = 0;   ///< sets without this head
    std::int64_t median_ns = 0;  ///< median of its mid-exposure minus the set's, signed
    std::int64_t p99_ns = 0;     ///< 99th percentile of the absolute offset
    std::int64_t worst_ns = 0;
    std::vector<std::optional<std::int64_t>> offsets;  ///< by set
  };
  std::vector<Head> heads() const;
  SyncFigures spread() const;
  std::optional<SyncFigures> begin_spread() const;  ///< nothing if no set was exposed by a pulse
  std::optional<std::int32_t> drift_ppb() const;    ///< the newest known value
  std::uint64_t sets_lost() const;      ///< numbers between the first and the last set without a raymap, or dropped
  std::uint64_t triggers_lost() const;  ///< pulses between the first and the last set for which no set arrived
  std::map<std::string, std::uint64_t> states() const;

  std::vector<std::string> lines() const;  ///< the report as text
  Json json() const;
  /// All heads' offsets over the sets, in one drawing.
  std::string svg() const;

 private:
  std::vector<std::string> names_;
  std::vector<wire::RaymapHeader> sets_;
  std::uint64_t dropped_ = 0;
};

}  // namespace nodal::host
