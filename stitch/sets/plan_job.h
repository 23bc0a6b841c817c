// Makes the plan of a calibration in slices.
#pragma once

#include <utility>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/sets/blend_plan.h"
#include "stitch/sets/table_job.h"

namespace nodal::sets {

/// The only way from a calibration to the plan that a rig and the renderer of a take blend with.
///
/// Threading: thread-bound.
/// Ownership: copies the calibration.
/// Errors: those of TableJob, of the meter's table and of SeamViews, from make() or finish().
class PlanJob {
 public:
  /// As TableJob::make().
  static Result<PlanJob> make(const Calibration& calibration, const RaymapConfig& raymap, Fields fields,
                              std::vector<PixelFormat> formats);

  /// The slices: compiles the tables. Nearly all of the work.
  TableJob& tables() { return tables_; }
  const TableJob& tables() const { return tables_; }
  /// The plan, under the calibration's `id` on the rig. Only when the tables are done().
  Result<PlanPtr> finish(const Sha256& id) &&;

 private:
  PlanJob(Calibration calibration, const RaymapConfig& raymap, TableJob tables)
      : calibration_(std::move(calibration)), raymap_(raymap), tables_(std::move(tables)) {}

  Calibration calibration_;
  RaymapConfig raymap_;
  TableJob tables_;
};

}  // namespace nodal::sets
