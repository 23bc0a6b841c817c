#include "stitch/sets/blend_plan.h"

#include <utility>

#include "protocol/base/try.h"
#include "stitch/sets/seam_views.h"

namespace nodal::sets {

PlanPtr make_plan(const Sha256& id, std::string name, std::vector<blend::BlendTable> tables, blend::MeterTable meter,
                  blend::ToneTable exposures, std::vector<PixelFormat> delivered,
                  std::shared_ptr<const SeamViews> seams) {
  NODAL_ASSERT(tables.size() == 1 || tables.size() == 2);
  if (delivered.empty()) {
    for (const blend::BlendTable::Source& source : tables[0].sources) delivered.push_back(source.format);
  }
  const blend::SetTone tone = blend::calibrated_tone(tables[0]);  // both fields have the same light
  return std::make_shared<const BlendPlan>(BlendPlan{id,
                                                     std::move(name),
                                                     std::move(tables),
                                                     std::move(delivered),
                                                     tone,
                                                     std::move(meter),
                                                     std::move(exposures),
                                                     std::move(seams),
                                                     {}});
}

Result<PlanPtr> with_seams(const BlendPlan& plan, std::vector<std::uint8_t> labels) {
  const SeamLabels& before = plan.seam_labels;
  NODAL_TRY_ASSIGN(auto tables,
                   plan.seams->tables(plan.tables, before ? *before : std::vector<std::uint8_t>(), labels));
  return std::make_shared<const BlendPlan>(
      BlendPlan{plan.id, plan.name, std::move(tables), plan.delivered, plan.tone, plan.meter, plan.exposures,
                plan.seams, std::make_shared<const std::vector<std::uint8_t>>(std::move(labels))});
}

}  // namespace nodal::sets
