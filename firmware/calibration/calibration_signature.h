// Checks that a calibration is signed by a trusted key, for this rig, and is no older than one that the rig has had.
// Without `signers`, every calibration is permitted.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "firmware/calibration/calibration_store.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "protocol/ssh_signature.h"

namespace nodal::firmware {

/// What a rig permits.
struct SignatureRules {
  const std::optional<AllowedSigners>& signers;
  std::string rig;               ///< its name, which a signature must have
  std::uint64_t generation = 0;  ///< the highest one that was permitted so far; 0: none
};

/// What is known of a permitted calibration.
struct Permitted {
  std::uint64_t generation = 0;  ///< generation of its signature; 0: signed for no rig, or no signature is required
};

/// Checks a calibration's signature and its rig. Errors: AllowedSigners::verify()'s; kBadValue if it is signed for
/// another rig. They say how to sign.
Result<Permitted> check_signature(const SignatureRules& rules, const SignedDocument& original);

/// Whether the calibration is stored with a signature of the same generation.
bool has_signature(const CalibrationStore& store, const SignatureRules& rules, const Sha256& id, const Permitted& same);

/// Refuses a generation below the highest, one that another calibration has (`known`: this one was permitted before),
/// and a signature that names no rig and no generation. Errors: kBadValue, which names --allow-older.
Status check_generation(const SignatureRules& rules, const Permitted& permitted, bool known);

/// Loads a stored calibration and checks it against the present signers, which may have changed since it was uploaded.
/// Errors: the store's, check_signature()'s, kChecksum if the signature is for another calibration.
struct LoadedCalibration {
  Calibration calibration;
  Permitted permitted;
};
Result<LoadedCalibration> load_permitted(const CalibrationStore& store, const SignatureRules& rules, const Sha256& id);

}  // namespace nodal::firmware
