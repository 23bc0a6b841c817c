// Which options of `nodal register` may help after a registration failed.
#pragma once

#include "protocol/base/result.h"

namespace nodal::host {

/// Appends to errors 202 (no coverage) and 204 (head mismatch) which options may help, and in which case. Other errors
/// are unchanged. `nominal`: the rig came from its data sheet, so the options that describe it are named, too.
Error with_advice(Error error, bool nominal);

}  // namespace nodal::host
