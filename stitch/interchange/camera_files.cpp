#include "stitch/interchange/camera_files.h"

#include <string>

#include "protocol/base/try.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/opencv_xml.h"

namespace nodal::interchange {
namespace {

Status add_camera(std::string_view text, std::string_view path, ImportResult& result) {
  if (is_opencv(text)) return add_opencv_camera(text, path, result);
  if (is_ocam(text)) return add_ocam_camera(text, path, result);
  return fail(Errc::kBadFormat,
              "it is no camera of OpenCV or OCamCalib; several files make one rig only when each of them is");
}

}  // namespace

bool is_opencv(std::string_view text) {
  return text.starts_with("%YAML") || is_xml(text) || text.find("camera_matrix") != std::string_view::npos;
}

bool is_ocam(std::string_view text) { return text.find("ocam_model") != std::string_view::npos; }

Result<ImportResult> import_camera(std::string_view text, std::string_view name) {
  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a camera's file.";
  NODAL_TRY(add_camera(text, std::string(name) + ".", result));
  NODAL_TRY(check_calibration(result.calibration));
  return result;
}

Result<ImportResult> import_cameras(std::span<const CameraFile> files, std::string_view name) {
  NODAL_TRY(check_head_count(files.size()));
  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from cameras' files, one a head.";
  for (const CameraFile& file : files) {
    if (const Status added = add_camera(file.text, file.path, result); !added) return fail(added.error().in(file.path));
  }
  result.notes.emplace_back(
      "The files do not say how the cameras stand to each other: all look forward; place them "
      "with `nodal pairs`, then `nodal register`.");
  NODAL_TRY(check_calibration(result.calibration));
  return result;
}

}  // namespace nodal::interchange
