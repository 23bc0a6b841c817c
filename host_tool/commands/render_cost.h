// What a raymap costs before it is made: the take that asks for it may come from anywhere.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

struct RenderCost {
  std::uint64_t bytes = 0;  ///< memory of blend tables, raymap and pictures
  double seconds = 0;       ///< to compile the tables, on all threads
};

/// Estimates the cost from a blend table of the same layout that is small enough to be compiled at once. Nothing if no
/// table can be compiled, which rendering then reports.
std::optional<RenderCost> cost_of(const std::vector<const Calibration*>& calibrations, const RaymapConfig& raymap,
                                  int threads);

/// What this process can still allocate: memory that the system has free, and the address space up to the process's
/// limit.
std::uint64_t free_memory();

/// Errors: kTooLarge if `cost` is above `free`; it says both, and a width that fits.
Status check_cost(const RenderCost& cost, const RaymapConfig& raymap, std::uint64_t free);

/// Whether to say the cost before the work begins.
bool is_worth_saying(const RenderCost& cost, std::uint64_t free);

}  // namespace nodal::host
