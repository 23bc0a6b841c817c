// What the keeper answers at once: the list of calibrations, and their documents.
#include "firmware/calibration/calibration_keeper.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

Result<CalibrationAnswer::Listed> CalibrationKeeper::list() const {
  CalibrationAnswer::Listed listed{store_->entries(), report_.in_force, std::nullopt, std::nullopt};
  if (config_.signers) listed.signed_generation = store_->signed_generation();
  if (trial_.running()) {
    listed.on_trial.emplace(
        CalibrationStore::Entry{0, trial_.report().id, report_.name, trial_.calibration().heads.size(), ""});
  }
  return listed;
}

Result<CalibrationAnswer::Document> CalibrationKeeper::get(const std::string& id_prefix) const {
  if (id_prefix.empty() && !report_.in_force) return fail(Errc::kNotFound, "no calibration is in force");
  Sha256 id{};
  if (id_prefix.empty()) {
    id = *report_.in_force;
  } else {
    NODAL_TRY_ASSIGN(const auto found, store_->find(id_prefix));
    id = found.id;
  }
  if (trial_.running() && id == trial_.report().id) {
    return CalibrationAnswer::Document{id, canonical_json(trial_.calibration())};
  }
  NODAL_TRY_ASSIGN(auto json, store_->read(id));
  return CalibrationAnswer::Document{id, std::move(json)};
}

}  // namespace nodal::firmware
