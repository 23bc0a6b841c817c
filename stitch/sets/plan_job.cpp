#include "stitch/sets/plan_job.h"

#include <memory>

#include "protocol/base/try.h"
#include "stitch/sets/seam_views.h"
#include "stitch/table/meter_compiler.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::sets {

Result<PlanJob> PlanJob::make(const Calibration& calibration, const RaymapConfig& raymap, Fields fields,
                              std::vector<PixelFormat> formats) {
  NODAL_TRY_ASSIGN(auto tables, TableJob::make(calibration, raymap, fields, std::move(formats)));
  return PlanJob(calibration, raymap, std::move(tables));
}

Result<PlanPtr> PlanJob::finish(const Sha256& id) && {
  std::vector<PixelFormat> delivered = tables_.delivered();
  NODAL_TRY_ASSIGN(auto tables, std::move(tables_).finish());
  NODAL_TRY_ASSIGN(auto meter, table::compile_meter_table(calibration_));
  std::shared_ptr<const SeamViews> seams;
  if (raymap_.seams == SeamPlacement::kPlaced) {
    NODAL_TRY_ASSIGN(auto views, SeamViews::make(calibration_, raymap_, tables));
    seams = std::move(views);
  }
  return make_plan(id, calibration_.name, std::move(tables), std::move(meter),
                   table::compile_tone_table(calibration_, raymap_.format, raymap_.soft), std::move(delivered),
                   std::move(seams));
}

}  // namespace nodal::sets
