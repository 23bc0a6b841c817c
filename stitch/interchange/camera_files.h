// Files that hold one camera each, of OpenCV and of OCamCalib: alone, or several for one rig.
#pragma once

#include <string_view>

#include "protocol/base/result.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {

/// Add a file's camera to a rig, facing forward. Its name is the file's own for the camera; if there is none, or it is
/// taken, the name of the file at `path`.
/// Errors: those of the importers.
Status add_opencv_camera(std::string_view text, std::string_view path, ImportResult& result);
Status add_ocam_camera(std::string_view text, std::string_view path, ImportResult& result);

bool is_opencv(std::string_view text);
bool is_ocam(std::string_view text);

}  // namespace nodal::interchange
