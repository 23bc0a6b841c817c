// OpenCV's FileStorage YAML, as written by its calibration programs and by ROS: one camera per file, no orientation.
#include <algorithm>

#include "stitch/interchange/camera_files.h"
#include "stitch/interchange/foreign_head.h"
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

bool is_fisheye(const YamlFields& file) {
  const Result<double> flag = file.number_or("fisheye_model", 0);
  if (flag && *flag != 0) return true;
  const Result<std::string> model = file.text("distortion_model");
  return model && (*model == "fisheye" || *model == "equidistant" || *model == "kannala_brandt");
}

}  // namespace

Status add_opencv_camera(std::string_view text, std::string_view path, ImportResult& result) {
  const Result<YAML::Node> root = parse_foreign_yaml(text);
  if (!root) return fail(root.error());
  const YamlFields file(*root, "the camera");
  const Result<int> width = file.side("image_width");
  if (!width) return fail(width.error());
  const Result<int> height = file.side("image_height");
  if (!height) return fail(height.error());
  const Result<std::vector<double>> K = read_matrix(file, "camera_matrix");
  if (!K) return fail(K.error());
  if (K->size() != 9) return fail(Errc::kBadValue, "'camera_matrix' must hold 9 numbers");
  Result<std::vector<double>> distortion =
      read_matrix(file, file.has("distortion_coefficients") ? "distortion_coefficients" : "dist_coeffs");
  if (!distortion) return fail(distortion.error());

  std::vector<std::string> taken;
  for (const HeadCalibration& other : result.calibration.heads) taken.push_back(other.name);
  std::string camera(path);
  if (const Result<std::string> named = file.text("camera_name")) {
    if (std::ranges::find(taken, head_name(*named + ".", {})) == taken.end()) camera = *named + ".";
  }
  HeadCalibration head = blank_head(head_name(camera, taken), *width, *height);
  const PinholeNumbers pinhole{(*K)[0], (*K)[4], (*K)[2], (*K)[5]};
  const Status set = is_fisheye(file) ? set_kannala_brandt(pinhole, *distortion, head)
                                      : set_plumb_bob(pinhole, {*distortion}, head, result.notes);
  if (!set) return fail(set.error());
  if ((*K)[1] != 0) {
    result.notes.push_back("The camera matrix of head '" + head.name +
                           "' has a skew, which is left out: pixels have no shear.");
  }
  if (Status s = finish_head(head, result.notes); !s) return fail(s.error());
  result.calibration.heads.push_back(std::move(head));
  result.images.emplace_back();
  return {};
}

}  // namespace nodal::interchange
