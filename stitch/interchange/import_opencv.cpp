// OpenCV's FileStorage, YAML or XML, as written by its calibration programs and by ROS: one camera per file, no
// orientation.
#include <algorithm>
#include <initializer_list>

#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "stitch/interchange/camera_files.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/opencv_xml.h"
#include "stitch/interchange/panotools_head.h"
#include "stitch/interchange/pinhole_lens.h"
#include "stitch/interchange/yaml_fields.h"

namespace nodal::interchange {
namespace {

/// Reads rows, cols and data of an !!opencv-matrix, or of ROS's equivalent map.
Result<std::vector<double>> read_matrix(const YamlFields& file, const std::string& key) {
  if (!file.has(key)) {
    return fail(Errc::kMissingField, "there is no '" + key +
                                         "' in it; a camera's file has camera_matrix and "
                                         "distortion_coefficients");
  }
  const YamlFields matrix(file.at(key), "'" + key + "'");
  return matrix.numbers("data");
}

/// The first of `keys` that the file has; the last one if it has none.
std::string key_of(const YamlFields& file, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (file.has(key)) return key;
  }
  return *(keys.end() - 1);
}

/// Whether the lens is a fisheye: OpenCV's flag, ROS's distortion_model, or the camera_model of ROS's calibrator.
/// Errors: kUnsupported for a lens that has another name; kBadValue where two fields contradict each other.
Result<bool> read_is_fisheye(const YamlFields& file) {
  bool fisheye = false, pinhole = false;
  NODAL_TRY_ASSIGN(const double flag, file.number_or("fisheye_model", 0));
  fisheye = flag != 0;
  for (const char* key : {"distortion_model", "camera_model"}) {
    if (!file.has(key)) continue;
    NODAL_TRY_ASSIGN(const std::string model, file.text(key));
    if (model == "fisheye" || model == "equidistant" || model == "kannala_brandt") {
      fisheye = true;
    } else if (model == "plumb_bob" || model == "rational_polynomial" || model == "radtan" || model == "thin_prism") {
      pinhole = true;
    } else if (model != "pinhole" && !model.empty()) {  // ROS writes camera_model pinhole beside a fisheye's distortion
      return fail(Errc::kUnsupported, std::string("the camera's ") + key + " is '" + printable(model, 40) +
                                          "'; there are plumb_bob, rational_polynomial, equidistant and fisheye");
    }
  }
  if (fisheye && pinhole) {
    return fail(Errc::kBadValue,
                "the camera is a fisheye by one of fisheye_model, distortion_model and camera_model, and none by "
                "another; correct the wrong one");
  }
  return fisheye;
}

Result<YAML::Node> parse_storage(std::string_view text) {
  return is_xml(text) ? parse_storage_xml(text) : parse_foreign_yaml(text);
}

}  // namespace

Status add_opencv_camera(std::string_view text, std::string_view path, ImportResult& result) {
  NODAL_TRY_ASSIGN(const YAML::Node root, parse_storage(text));
  const YamlFields file(root, "the camera");
  NODAL_TRY_ASSIGN(const int width, file.side(key_of(file, {"image_Width", "image_width"})));
  NODAL_TRY_ASSIGN(const int height, file.side(key_of(file, {"image_Height", "image_height"})));
  NODAL_TRY_ASSIGN(const std::vector<double> K, read_matrix(file, key_of(file, {"Camera_Matrix", "camera_matrix"})));
  if (K.size() != 9) return fail(Errc::kBadValue, "'camera_matrix' must hold 9 numbers");
  NODAL_TRY_ASSIGN(
      std::vector<double> distortion,
      read_matrix(file, key_of(file, {"dist_coeffs", "Distortion_Coefficients", "distortion_coefficients"})));

  std::vector<std::string> taken;
  for (const HeadCalibration& other : result.calibration.heads) taken.push_back(other.name);
  std::string camera(path);
  if (const Result<std::string> named = file.text("camera_name")) {
    if (std::ranges::find(taken, head_name(*named + ".", {})) == taken.end()) camera = *named + ".";
  }
  HeadCalibration head = blank_head(head_name(camera, taken), width, height);
  const PinholeNumbers pinhole{K[0], K[4], K[2], K[5]};
  NODAL_TRY_ASSIGN(const bool fisheye, read_is_fisheye(file));
  NODAL_TRY(fisheye ? set_kannala_brandt(pinhole, distortion, head)
                    : set_plumb_bob(pinhole, {distortion}, head, result.notes));
  if (K[1] != 0) {
    result.notes.push_back("The camera matrix of head '" + head.name +
                           "' has a skew, which is left out: pixels have no shear.");
  }
  NODAL_TRY(finish_head(head, result.notes));
  FieldCheck check(opencv_fields());
  see_members(root, "camera", "head '" + head.name + "'", check);
  NODAL_TRY(check.tell(result.notes));
  result.calibration.heads.push_back(std::move(head));
  result.images.emplace_back();
  return {};
}

}  // namespace nodal::interchange
