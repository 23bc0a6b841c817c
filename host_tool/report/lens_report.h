// The result of `calibrate lens` as an HTML page.
#pragma once

#include <string>

#include "protocol/base/result.h"
#include "stitch/calibration/lens/calibrate.h"

namespace nodal::host {

/// One HTML file. Errors: those of media::png_file() and Head::make.
Result<std::string> lens_report(const calibration::LensCalibration& result, const std::string& model);

}  // namespace nodal::host
