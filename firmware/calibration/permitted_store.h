// The stored calibrations that the rig's rules about signatures permit.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "firmware/calibration/calibration_signature.h"
#include "firmware/calibration/calibration_store.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "protocol/ssh_signature.h"

namespace nodal::firmware {

/// The store behind the rules: no calibration goes into the store, or comes out of it to be put in force, without a
/// check of its signature. A calibration comes in force together with the generation of its signature.
///
/// Threading: thread-bound to the keeper. Calls block on the disk.
/// Ownership: the signers and the disk outlive it.
/// Errors: those of calibration_signature.h and of CalibrationStore; after an error, the calibration in force is the
///   same as before.
class PermittedStore {
 public:
  /// Without signers every calibration is permitted. `rig`: the name that signatures must have.
  PermittedStore(const std::optional<AllowedSigners>& signers, std::string rig)
      : signers_(signers), rig_(std::move(rig)) {}

  /// Reads the folder; call it once, before all others but status().
  Status open(hal::DiskPort& disk);
  /// Whether the store was opened, and if not, why.
  const Status& status() const { return status_; }
  /// For reading only. Call it only after open() succeeded.
  const CalibrationStore& contents() const { return *store_; }
  /// The highest generation of a permitted signature; empty: no signatures are required.
  std::optional<std::uint64_t> signed_generation() const;

  /// An uploaded calibration that is permitted; it is not stored yet.
  struct Accepted {
    Calibration calibration;
    Sha256 id{};
    std::optional<SignedDocument> original;  ///< empty: no signatures are required
    std::uint64_t generation = 0;            ///< generation of its signature; 0: none
    bool stored = false;                     ///< the store had it already
  };
  /// `allow_older`: a signature of an older generation, or without one, is accepted, too.
  Result<Accepted> accept(const SignedDocument& upload, bool allow_older) const;
  /// A stored one.
  Result<LoadedCalibration> load(const Sha256& id, bool allow_older) const;

  /// Stores it durably, without putting it in force.
  Status put(const Calibration& calibration, const std::optional<SignedDocument>& original);
  /// Puts a stored one in force on the disk.
  Status put_in_force(const Sha256& id, std::uint64_t generation);
  /// put() and put_in_force(); a calibration that could not be put in force is not kept.
  Status keep(const Calibration& calibration, const std::optional<SignedDocument>& original);
  void remove(const Sha256& id) { store_->remove(id); }

 private:
  SignatureRules rules() const { return {signers_, rig_, store_->signed_generation()}; }

  const std::optional<AllowedSigners>& signers_;
  const std::string rig_;
  std::optional<CalibrationStore> store_;
  Status status_;
};

}  // namespace nodal::firmware
