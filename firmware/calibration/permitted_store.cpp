#include "firmware/calibration/permitted_store.h"

#include <utility>

#include "protocol/base/try.h"

namespace nodal::firmware {

Status PermittedStore::open(hal::DiskPort& disk) {
  auto opened = CalibrationStore::open(disk);
  if (opened) store_.emplace(std::move(*opened));
  else status_ = fail(opened.error().in("calibration store"));
  return status_;
}

std::optional<std::uint64_t> PermittedStore::signed_generation() const {
  if (!signers_) return std::nullopt;
  return store_->signed_generation();
}

Result<PermittedStore::Accepted> PermittedStore::accept(const SignedDocument& upload, bool allow_older) const {
  const auto permitted = check_signature(rules(), upload);
  if (!permitted) return fail(permitted.error().in("calibration"));
  auto calibration = parse_calibration(upload.json);
  if (!calibration) return fail(calibration.error().in("calibration"));
  const Sha256 id = calibration_id(*calibration);
  const bool had = has_signature(*store_, rules(), id, *permitted);
  if (Status newest = check_generation(rules(), *permitted, had); !newest && !allow_older) {
    return fail(newest.error().in("calibration"));
  }
  Accepted accepted{std::move(*calibration), id, std::nullopt, permitted->generation, store_->read(id).has_value()};
  if (signers_) accepted.original = upload;
  return accepted;
}

Result<LoadedCalibration> PermittedStore::load(const Sha256& id, bool allow_older) const {
  NODAL_TRY_ASSIGN(auto loaded, load_permitted(*store_, rules(), id));
  if (const Status newest = check_generation(rules(), loaded.permitted, true); !newest && !allow_older) {
    return fail(newest.error().in("stored calibration " + short_id(id)));
  }
  return loaded;
}

Status PermittedStore::put(const Calibration& calibration, const std::optional<SignedDocument>& original) {
  if (const auto stored = store_->put(calibration, original); !stored) {
    return fail(stored.error().in("storing calibration " + short_id(calibration_id(calibration))));
  }
  return {};
}

Status PermittedStore::put_in_force(const Sha256& id, std::uint64_t generation) {
  NODAL_TRY(store_->note_signed(generation));
  return store_->set_in_force(id);
}

Status PermittedStore::keep(const Calibration& calibration, const std::optional<SignedDocument>& original) {
  const Sha256 id = calibration_id(calibration);
  const bool known = store_->read(id).has_value();
  NODAL_TRY(put(calibration, original));
  const auto permitted = check_signature(rules(), original.value_or(SignedDocument{}));
  const Status kept = permitted ? put_in_force(id, permitted->generation) : Status(fail(permitted.error()));
  if (kept) return {};
  if (!known) store_->remove(id);
  return fail(kept.error().in("putting calibration " + short_id(id) + " in force"));
}

}  // namespace nodal::firmware
