#include "host_tool/input/calibration_file.h"

#include <filesystem>
#include <utility>

#include "host_tool/console/files.h"
#include "protocol/base/try.h"

namespace nodal::host {

Result<CalibrationFile> parse_calibration_file(const std::string& text, const std::string& file) {
  CalibrationFile read;
  read.own = text.find("\"nodal_calibration\"") != std::string::npos;
  if (read.own) {
    Result<Calibration> own = parse_calibration(text);
    if (!own) return fail(own.error().in(file));
    read.content.calibration = std::move(*own);
    return read;
  }
  auto imported = interchange::import_project(text, std::filesystem::path(file).stem().string());
  if (!imported) return fail(imported.error().in(file));
  read.content = std::move(*imported);
  return read;
}

Result<CalibrationFile> read_calibration_file(const std::string& file) {
  NODAL_TRY_ASSIGN(const std::string text, read_file(file, kMaxCalibrationFileBytes));
  return parse_calibration_file(text, file);
}

Result<Calibration> read_calibration(const std::string& file, Console& console) {
  NODAL_TRY_ASSIGN(CalibrationFile read, read_calibration_file(file));
  for (const std::string& note : read.content.notes) console.note("note: " + note);
  return std::move(read.content.calibration);
}

}  // namespace nodal::host
