// The result of a registration as an HTML page.
#pragma once

#include <string>
#include <string_view>

#include "host_tool/report/html_report.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// A sentence that names the placed heads whose pairs the report marks red (kPoorAgreement); empty if there are none.
std::string poor_pairs(const registration::Report& report);

/// One HTML file: heads with their uncertainties, the decrease of the objective, the sphere and the heads' differences
/// before and after, the overlaps, and close-ups of the largest seams. Of several frame sets the first is shown.
/// `verdict`: a sentence on the seams; empty: none. Errors: those of the calibrations.
Result<HtmlReport> registration_report(const Calibration& prior, const registration::FrameSet& frames,
                                       const registration::Report& report, std::string_view verdict = {});

}  // namespace nodal::host
