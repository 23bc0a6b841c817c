// The simultaneity of a rig's exposures over many sets, from the timing evidence of each set.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/console/console.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

/// Of a list of lengths of time, ns. Percentiles are by nearest rank: the value that so many are not above.
struct SyncFigures {
  std::int64_t median_ns = 0;
  std::int64_t p99_ns = 0;
  std::int64_t worst_ns = 0;
  static SyncFigures of(std::vector<std::int64_t> values);
};

/// Threading: thread-bound.
/// Ownership: keeps what each set said.
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
    std::uint64_t missing = 0;   ///< sets without it
    std::int64_t median_ns = 0;  ///< of its mid-exposure after the set's, with its sign
    std::int64_t p99_ns = 0;     ///< of how far it was off, either way
    std::int64_t worst_ns = 0;
    std::vector<std::optional<std::int64_t>> offsets;  ///< by set
  };
  std::vector<Head> heads() const;
  SyncFigures spread() const;
  std::optional<SyncFigures> begin_spread() const;  ///< when a pulse exposed any set
  std::optional<std::int32_t> drift_ppb() const;    ///< the newest that was known
  std::uint64_t sets_lost() const;      ///< numbers between the first and the last that made no raymap, or were dropped
  std::uint64_t triggers_lost() const;  ///< pulses between the first and the last that exposed no set that came
  std::map<std::string, std::uint64_t> states() const;

  std::vector<std::string> lines() const;  ///< for people
  Json json() const;
  /// Every head's offset over the sets, as one picture.
  std::string svg() const;

 private:
  std::vector<std::string> names_;
  std::vector<wire::RaymapHeader> sets_;
  std::uint64_t dropped_ = 0;
};

}  // namespace nodal::host
