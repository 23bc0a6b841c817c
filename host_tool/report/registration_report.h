// The result of a registration as an HTML page.
#pragma once

#include <string>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// One HTML file: heads with their uncertainties, how the objective fell, the sphere and what the heads differ by before
/// and after, who sees what, and the largest seams as close-ups. Of several frame sets the first is shown.
/// Errors: those of the calibrations.
Result<std::string> registration_report(const Calibration& prior, const registration::FrameSet& frames,
                                        const registration::Report& report);

}  // namespace nodal::host
