// The plan of a film: what is accepted has heads, frames and seams that fit each other, and is the same plan when it is
// written and read again.
#include "host_tool/film/film_plan.h"
#include "memory_limit.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{256} << 20), true);
  (void)limited;
  const auto plan = film::plan_of(std::string(reinterpret_cast<const char*>(data), size));
  if (!plan) return 0;
  NODAL_ASSERT(plan->heads.size() == plan->calibration.heads.size() && plan->frames > 0);
  for (const film::PlannedHead& head : plan->heads) NODAL_ASSERT(head.times.size() == plan->frames);
  for (const film::PlannedSeams& seams : plan->seams) NODAL_ASSERT(seams.segment < plan->segments());
  const std::string text = to_text(*plan);
  const auto again = film::plan_of(text);
  NODAL_ASSERT(again.has_value() && to_text(*again) == text);
  return 0;
}
