#include "host_tool/report/sync_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tool/console/quantities.h"

namespace nodal::host {
namespace {

std::string signed_time(std::int64_t ns) { return (ns < 0 ? "-" : "+") + show_duration(magnitude(ns)); }
std::string time(std::int64_t ns) { return show_duration(static_cast<std::uint64_t>(ns)); }

Json figures_json(const SyncFigures& figures) {
  return {{"median_ns", figures.median_ns}, {"p99_ns", figures.p99_ns}, {"worst_ns", figures.worst_ns}};
}

}  // namespace

SyncFigures SyncFigures::of(std::vector<std::int64_t> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto rank = [&](std::size_t percent) { return values[(values.size() * percent + 99) / 100 - 1]; };
  return {rank(50), rank(99), values.back()};
}

void SyncReport::add(const wire::RaymapHeader& set) { sets_.push_back(set); }

std::vector<SyncReport::Head> SyncReport::heads() const {
  std::vector<Head> all;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    Head head;
    head.name = names_[i];
    std::vector<std::int64_t> seen, off;
    for (const wire::RaymapHeader& set : sets_) {
      const bool present = (set.heads_mask() >> i & 1) != 0 && static_cast<int>(i) < set.offset_ns_size();
      head.offsets.emplace_back();
      if (!present) {
        ++head.missing;
        continue;
      }
      head.offsets.back() = set.offset_ns(static_cast<int>(i));
      seen.push_back(*head.offsets.back());
      off.push_back(static_cast<std::int64_t>(std::min<std::uint64_t>(magnitude(seen.back()), INT64_MAX)));
    }
    head.median_ns = SyncFigures::of(std::move(seen)).median_ns;
    const SyncFigures figures = SyncFigures::of(std::move(off));
    head.p99_ns = figures.p99_ns;
    head.worst_ns = figures.worst_ns;
    all.push_back(std::move(head));
  }
  return all;
}

SyncFigures SyncReport::spread() const {
  std::vector<std::int64_t> values;
  for (const wire::RaymapHeader& set : sets_) values.push_back(static_cast<std::int64_t>(set.spread_ns()));
  return SyncFigures::of(std::move(values));
}

std::optional<SyncFigures> SyncReport::begin_spread() const {
  std::vector<std::int64_t> values;
  for (const wire::RaymapHeader& set : sets_) {
    if (set.has_begin_spread_ns()) values.push_back(static_cast<std::int64_t>(set.begin_spread_ns()));
  }
  if (values.empty()) return std::nullopt;
  return SyncFigures::of(std::move(values));
}

std::optional<std::int32_t> SyncReport::drift_ppb() const {
  const auto newest = std::find_if(sets_.rbegin(), sets_.rend(), [](const auto& set) { return set.has_drift_ppb(); });
  if (newest == sets_.rend()) return std::nullopt;
  return newest->drift_ppb();
}

std::uint64_t SyncReport::sets_lost() const {
  return sets_.empty() ? 0 : sets_.back().set() - sets_.front().set() + 1 - sets_.size();
}

std::uint64_t SyncReport::triggers_lost() const {
  std::uint64_t lost = 0;
  std::optional<std::uint64_t> before;
  for (const wire::RaymapHeader& set : sets_) {
    if (!set.has_trigger()) {
      before.reset();
      continue;
    }
    // A restarted genlock counts its pulses from 0 again.
    if (before && set.trigger() > *before) lost += set.trigger() - *before - 1;
    before = set.trigger();
  }
  return lost;
}

std::map<std::string, std::uint64_t> SyncReport::states() const {
  std::map<std::string, std::uint64_t> states;
  for (const wire::RaymapHeader& set : sets_) ++states[set.genlock()];
  return states;
}

std::vector<std::string> SyncReport::lines() const {
  using Align = Table::Align;
  Table table({{"head"},
               {"median", Align::kRight},
               {"p99", Align::kRight},
               {"worst", Align::kRight},
               {"missing", Align::kRight}});
  for (const Head& head : heads()) {
    if (head.missing == sets_.size()) {
      table.row({head.name, "-", "-", "-", std::to_string(head.missing)});
    } else {
      table.row({head.name, signed_time(head.median_ns), time(head.p99_ns), time(head.worst_ns),
                 std::to_string(head.missing)});
    }
  }
  std::vector<std::string> lines = table.lines();
  const auto figures = [](const char* what, const SyncFigures& f) {
    return fmt::format("{}: median {}, p99 {}, worst {}", what, time(f.median_ns), time(f.p99_ns), time(f.worst_ns));
  };
  lines.push_back(figures("spread of mid-exposures", spread()));
  if (const auto begins = begin_spread()) lines.push_back(figures("spread of begins after their pulse", *begins));
  const auto drift = drift_ppb();
  lines.push_back(drift ? fmt::format("drift against the rig's clock: {:+.3f} ppm", *drift / 1000.0)
                        : "drift against the rig's clock: not known yet");
  std::string state;
  for (const auto& [name, count] : states()) state += fmt::format("{}{} {}", state.empty() ? "" : ", ", name, count);
  lines.push_back("genlock: " + state);
  lines.push_back(fmt::format("{}; {} lost, {} of them between the rig and this computer; no set came for {}",
                              counted(sets_.size(), "set"), sets_lost(), std::min(dropped_, sets_lost()),
                              counted(triggers_lost(), "pulse")));
  return lines;
}

Json SyncReport::json() const {
  Json list = Json::array();
  for (const Head& head : heads()) {
    list.push_back({{"name", head.name},
                    {"median_ns", head.median_ns},
                    {"p99_ns", head.p99_ns},
                    {"worst_ns", head.worst_ns},
                    {"missing", head.missing}});
  }
  const auto begins = begin_spread();
  const auto drift = drift_ppb();
  return {{"sets", sets_.size()},
          {"first_set", sets_.empty() ? 0 : sets_.front().set()},
          {"sets_lost", sets_lost()},
          {"dropped", dropped_},
          {"triggers_lost", triggers_lost()},
          {"spread", figures_json(spread())},
          {"begin_spread", begins ? figures_json(*begins) : Json()},
          {"drift_ppb", drift ? Json(*drift) : Json()},
          {"genlock", states()},
          {"heads", list}};
}

}  // namespace nodal::host
