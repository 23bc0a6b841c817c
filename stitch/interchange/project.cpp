#include "stitch/interchange/project.h"

#include <fmt/format.h>

#include <array>
#include <cstdio>

#include "protocol/base/try.h"
#include "stitch/interchange/camera_files.h"

namespace nodal::interchange {
namespace {

/// Kalibr calls cameras cam0, cam1 and so on; OpenCV's file is of one camera, which may be called so.
bool is_kalibr(std::string_view text) {
  const auto says = [text](std::string_view word) { return text.find(word) != std::string_view::npos; };
  return says("cam0") && (says("distortion_model") || says("camera_model")) && !says("camera_matrix");
}

constexpr const char* kUnknown =
    "it is none of the files Nodal knows: Hugin's .pto, PTGui's text .pts (of PTGui 9 and older; newer ones save as "
    "JSON: export them as a text project), VideoStitch's .ptv, Surround360's JSON, OpenCV's YAML or XML, Kalibr's "
    "YAML, "
    "OCamCalib's calib_results.txt";

}  // namespace

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

Status add_control_points(const std::vector<ScriptLine>& lines, std::span<const std::optional<std::size_t>> head_of,
                          ImportResult& result, int first_image) {
  const double heads = static_cast<double>(head_of.size());
  for (const ScriptLine& line : lines) {
    if (line.kind != 'c') continue;
    const std::string* type = line.find("t");
    if (type != nullptr && *type != "0") continue;  // lines to be straightened, not points
    std::array<double, 6> numbers{};
    constexpr std::array kNames{"n", "N", "x", "y", "X", "Y"};
    for (std::size_t k = 0; k < kNames.size(); ++k) {
      const std::string* value = line.find(kNames[k]);
      if (value == nullptr) {
        return fail(Errc::kMissingField, fmt::format("line {}: the control point has no {}", line.number, kNames[k]));
      }
      NODAL_TRY_ASSIGN(const double number, to_number(line, kNames[k], *value));
      numbers[k] = number - (k < 2 ? first_image : 0);
    }
    if (!(numbers[0] >= 0 && numbers[0] < heads && numbers[1] >= 0 && numbers[1] < heads)) {
      return fail(Errc::kBadValue,
                  fmt::format("line {}: the control point is on an image that is not there", line.number));
    }
    const std::optional<std::size_t> a = head_of[static_cast<std::size_t>(numbers[0])];
    const std::optional<std::size_t> b = head_of[static_cast<std::size_t>(numbers[1])];
    if (!a || !b) continue;
    result.control_points.push_back(
        {*a, {numbers[2] + 0.5, numbers[3] + 0.5}, *b, {numbers[4] + 0.5, numbers[5] + 0.5}});
  }
  return {};
}

Result<ImportResult> import_project(std::string_view text, std::string_view name) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  const auto says = [text](std::string_view word) { return text.find(word) != std::string_view::npos; };
  if (first != std::string_view::npos && text[first] == '{') {
    if (says("\"nodal_calibration\"")) {
      return fail(Errc::kBadFormat, "it is a calibration of Nodal's already: there is nothing to import");
    }
    if (says("\"cameras\"")) return import_surround360(text, name);
    if (says("\"inputs\"") || says("\"pano\"")) return import_videostitch(text, name);
    return fail(Errc::kBadFormat, kUnknown);
  }
  if (is_kalibr(text)) return import_kalibr(text, name);
  if (is_opencv(text) || is_ocam(text)) return import_camera(text, name);
  NODAL_TRY_ASSIGN(const std::vector<ScriptLine> lines, parse_script(text, kMaxProjectBytes));
  bool ptgui = false, hugin = false;
  for (const ScriptLine& line : lines) {
    ptgui = ptgui || line.comment.starts_with("# ptGui") || line.comment.starts_with("#-imgfile");
    hugin = hugin || line.kind == 'i' || line.comment.starts_with("# hugin");
  }
  if (ptgui) return import_pts(text, name);
  if (hugin) return import_pto(text, name);
  return fail(Errc::kBadFormat, kUnknown);
}

}  // namespace nodal::interchange
