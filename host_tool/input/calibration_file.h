// A calibration from a file of any format that Nodal reads.
#pragma once

#include <algorithm>
#include <string>

#include "host_tool/console/console.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/interchange/import.h"

namespace nodal::host {

inline constexpr std::size_t kMaxCalibrationFileBytes = std::max(kMaxCalibrationBytes, interchange::kMaxProjectBytes);

struct CalibrationFile {
  /// Of Nodal's own format only the calibration is filled in.
  interchange::ImportResult content;
  bool own = true;  ///< Nodal's own format; false: a project of another program, or its cameras
};

/// `file`: its name, for errors and for the name of a project's calibration.
/// Errors: those of parse_calibration() and of interchange::import_project(), with the file.
Result<CalibrationFile> parse_calibration_file(const std::string& text, const std::string& file);

/// The same for a file. Errors: also those of read_file().
Result<CalibrationFile> read_calibration_file(const std::string& file);

/// The calibration alone; what could not be imported exactly is told on the console. Errors: as above.
Result<Calibration> read_calibration(const std::string& file, Console& console);

}  // namespace nodal::host
