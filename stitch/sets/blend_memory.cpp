#include "stitch/sets/blend_memory.h"

#include <algorithm>
#include <utility>

#include "stitch/blend/prepare.h"

namespace nodal::sets {
namespace {

/// The maximum, not the sum, because fields are blended one after the other, and after the views.
std::size_t prepared_bytes(const BlendPlan& plan) {
  std::size_t most = 0;
  for (const blend::BlendTable& table : plan.tables) {
    std::size_t bytes = 0;
    for (const blend::BlendTable::Source& source : table.sources) bytes += blend::prepared_size(source);
    most = std::max(most, bytes);
  }
  if (!plan.seams) return most;
  std::size_t bytes = 0;
  for (std::size_t h = 0; h < plan.delivered.size(); ++h) bytes += plan.seams->scratch_size(h);
  return std::max(most, bytes);
}

}  // namespace

BlendMemory::BlendMemory(const BlendPlan& plan) : prepared(prepared_bytes(plan)) {
  decoders.reserve(plan.delivered.size());
  for (std::size_t i = 0; i < plan.delivered.size(); ++i) {
    const blend::BlendTable::Source& source = plan.tables[0].sources[i];
    const int rows = source.field ? 2 * source.height : source.height;  // rows of the whole frame
    decoders.emplace_back(plan.delivered[i], source.format, source.width, rows);
  }
  if (plan.seams) seam_pictures = plan.seams->empty_pictures();
}

BlendSetup with_memory(PlanPtr plan) {
  auto memory = std::make_shared<BlendMemory>(*plan);
  return {std::move(plan), std::move(memory)};
}

}  // namespace nodal::sets
