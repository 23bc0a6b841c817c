// Checks that a calibration is signed by a trusted key. Without `signers`, every calibration is permitted.
#pragma once

#include <optional>

#include "firmware/calibration/calibration_store.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "protocol/ssh_signature.h"

namespace nodal::firmware {

/// Checks an uploaded calibration. Errors: AllowedSigners::verify()'s.
Status check_signature(const std::optional<AllowedSigners>& signers, const SignedDocument& original);

/// Loads a stored calibration and checks it against the present signers, which may have changed since it was uploaded.
/// Errors: the store's, AllowedSigners::verify()'s, kChecksum if the signature is for another calibration.
Result<Calibration> load_permitted(const CalibrationStore& store, const std::optional<AllowedSigners>& signers,
                                   const Sha256& id);

}  // namespace nodal::firmware
