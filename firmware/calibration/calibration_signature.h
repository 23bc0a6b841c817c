// Whether a calibration is signed by somebody this rig trusts. Without `signers`, every calibration is permitted.
#pragma once

#include <optional>

#include "firmware/calibration/calibration_store.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "protocol/ssh_signature.h"

namespace nodal::firmware {

/// Of an uploaded one. Errors: AllowedSigners::verify()'s.
Status check_signature(const std::optional<AllowedSigners>& signers, const SignedDocument& original);

/// A stored one, held to the signers of this start, which may have changed since it came.
/// Errors: the store's, AllowedSigners::verify()'s, kChecksum for a signature of another calibration.
Result<Calibration> load_permitted(const CalibrationStore& store, const std::optional<AllowedSigners>& signers,
                                   const Sha256& id);

}  // namespace nodal::firmware
