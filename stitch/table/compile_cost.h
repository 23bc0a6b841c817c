// The work of compiling a table, counted before it is compiled: the same on every machine, unlike seconds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::table {

class RaySampler;

/// Cost in steps; a step takes about a nanosecond on a processor of 2020. The cost of a ray depends on the heads that
/// see it, on the corners of their masks near it, and on whether their lenses are tabled; the sum over the raymap is
/// estimated from about kRays of its rays.
struct CompileCost {
  std::vector<std::uint64_t> heads;  ///< cost of each head
  std::uint64_t total = 0;           ///< sum over all heads

  static constexpr int kRays = 4096;
};

CompileCost compile_cost(const RaySampler& sampler);

/// Largest cost of a table that a rig's board compiles, for a raymap with this many pixels and heads.
constexpr std::uint64_t compile_budget(std::uint64_t pixels, std::size_t heads) {
  constexpr std::uint64_t kStepsAPixel = 2000;
  constexpr std::uint64_t kStepsAPixelAndHead = 400;
  return pixels * (kStepsAPixel + kStepsAPixelAndHead * heads);
}

/// Checks that the cost is within the budget. Errors: kTooLarge, naming the head that costs most.
Status check_compile_budget(const CompileCost& cost, const Calibration& calibration, std::uint64_t pixels);

}  // namespace nodal::table
