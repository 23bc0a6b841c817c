// VideoStitch's project (.ptv), interpreted as by stitchEm: JSON, focal lengths in px, the Panorama Tools polynomial.
#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "protocol/base/try.h"
#include "protocol/calibration_limits.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/json_fields.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/photometry.h"
#include "stitch/interchange/project.h"
#include "stitch/interchange/videostitch_lens.h"

namespace nodal::interchange {
namespace {

using nlohmann::json;

/// What is read of a project, and what is said of it.
struct Reading {
  ImportResult result;
  Eigen::Matrix3d R_rig_pano = Eigen::Matrix3d::Identity();
  std::vector<Eigen::Vector3d> positions;
  std::vector<Photometry> light;
  std::vector<int> head_of;        ///< each input's head, or -1
  std::set<std::string> changing;  ///< fields that change over time
  FieldCheck check{videostitch_fields()};
};

bool is_false(const JsonFields& fields, const char* key) { return fields.has(key) && fields[key] == false; }

Result<Crop> read_crop(const JsonFields& input, double width, double height) {
  Crop crop{0, width, 0, height};
  const std::array<std::pair<const char*, double*>, 4> edges{
      {{"crop_left", &crop.left}, {"crop_right", &crop.right}, {"crop_top", &crop.top}, {"crop_bottom", &crop.bottom}}};
  for (const auto& [key, value] : edges) {
    NODAL_TRY_ASSIGN(const double edge, input.number_or(key, *value));
    *value = edge;
  }
  if (crop.left < crop.right && crop.top < crop.bottom) return crop;
  return fail(Errc::kBadValue, input.where() + ": its crop has no area");
}

/// A number, or the first value of a curve over time.
Result<double> read_curve(const JsonFields& fields, const char* key, double otherwise,
                          std::set<std::string>& changing) {
  if (!fields.has(key)) return otherwise;
  const json& value = videostitch::first_value(fields[key], key, changing);
  if (value.is_number() && std::isfinite(value.get<double>())) return value.get<double>();
  return fail(Errc::kBadValue, fields.where() + ": the field '" + key + "' must be a number or a curve");
}

/// Errors: kBadValue with the field.
Result<Photometry> read_light(const JsonFields& input, const Crop& crop, Reading& reading) {
  Photometry p;
  constexpr std::array kBalance{"red_corr", "green_corr", "blue_corr"};
  constexpr double kMaxStops = 20, kMaxBalance = 100;
  for (std::size_t c = 0; c < kBalance.size(); ++c) {
    NODAL_TRY_ASSIGN(const double correction, read_curve(input, kBalance[c], 1, reading.changing));
    if (!(correction >= 1 / kMaxBalance && correction <= kMaxBalance)) {
      return fail(Errc::kBadValue, input.where() + ": the field '" + kBalance[c] + "' must be 0.01 to 100");
    }
    p.balance[c] = correction;
  }
  NODAL_TRY_ASSIGN(const double ev, read_curve(input, "ev", 0, reading.changing));
  if (!(std::abs(ev) <= kMaxStops)) return fail(Errc::kBadValue, input.where() + ": the field 'ev' must be -20 to 20");
  p.stops = ev;
  const std::array<std::pair<const char*, double*>, 7> numbers{{{"vign_a", p.V.data()},
                                                                {"vign_b", &p.V[1]},
                                                                {"vign_c", &p.V[2]},
                                                                {"vign_d", &p.V[3]},
                                                                {"vign_x", &p.Vx},
                                                                {"vign_y", &p.Vy},
                                                                {"gamma", &p.gamma}}};
  for (const auto& [key, value] : numbers) {
    NODAL_TRY_ASSIGN(const double number, input.number_or(key, *value));
    *value = number;
  }
  if (!(p.V[0] > 0)) return fail(Errc::kBadValue, input.where() + ": the field 'vign_a' must be more than 0");
  p.radius = std::hypot(crop.right - crop.left, crop.bottom - crop.top) / 2;
  const std::string response = input.has("response") ? input.text("response").value_or("") : "emor";
  if (response == "linear") p.response = ForeignResponse::kLinear;
  if (response == "gamma") p.response = ForeignResponse::kGamma;
  if (response == "gamma" && p.gamma == 1) p.response = ForeignResponse::kLinear;
  if (response == "emor" || response == "linear" || response == "gamma") return p;
  if (response == "inverse_emor" || response == "curve") {
    p.response = ForeignResponse::kLinear;
    reading.result.notes.push_back("The response of " + input.where() + ", '" + response +
                                   "', is left out: it is taken as linear.");
    return p;
  }
  return fail(Errc::kBadValue,
              input.where() + ": the field 'response' must be linear, gamma, emor, inverse_emor or curve");
}

/// Compares an input's fields with the table; those that only matter with another field are left out without it.
void see_input(const json& input, const std::string& where, FieldCheck& check) {
  json seen = input;
  if (!seen.is_object()) return;
  const auto is = [&](const char* key, const char* value) { return seen.contains(key) && seen[key] == value; };
  const bool cropped = std::ranges::any_of(std::array{"crop_left", "crop_right", "crop_top", "crop_bottom"},
                                           [&](const char* key) { return seen.contains(key); });
  if (!cropped) seen.erase("relative_to_cropped_area");
  if (!is("response", "curve")) seen.erase("response_curve");
  if (is("response", "linear") || is("response", "gamma") || is("response", "curve")) {
    for (const char* key : {"emor_a", "emor_b", "emor_c", "emor_d", "emor_e"}) seen.erase(key);
  }
  see_members(seen, "input", where, check);
}

Result<HeadCalibration> read_input(const json& value, std::size_t index, Reading& reading) {
  ImportResult& result = reading.result;
  const JsonFields input(value, fmt::format("input {}", index));
  NODAL_TRY_ASSIGN(const int width, input.side("width"));
  NODAL_TRY_ASSIGN(const int height, input.side("height"));
  std::string file;
  for (const char* key : {"filename", "reader_config"}) {
    if (input.has(key) && input[key].is_string()) file = input[key].get<std::string>();
  }
  std::vector<std::string> taken;
  for (const HeadCalibration& head : result.calibration.heads) taken.push_back(head.name);
  HeadCalibration head = blank_head(head_name(file, taken), width, height);
  result.images.push_back(file);

  NODAL_TRY_ASSIGN(const Crop crop, read_crop(input, width, height));
  NODAL_TRY_ASSIGN(const videostitch::Geometry g,
                   videostitch::read_geometry(input, crop, reading.changing, reading.check));
  head.center_x = (crop.left + crop.right) / 2 + g.center_x;
  head.center_y = (crop.top + crop.bottom) / 2 + g.center_y;
  head.region.left = std::clamp(crop.left, 0.0, head.region.right);
  head.region.right = std::clamp(crop.right, 0.0, head.region.right);
  head.region.top = std::clamp(crop.top, 0.0, head.region.bottom);
  head.region.bottom = std::clamp(crop.bottom, 0.0, head.region.bottom);
  if (g.lens.circle) {
    head.region.circle = {(crop.left + crop.right) / 2, (crop.top + crop.bottom) / 2, g.lens.unit};
  }
  const Eigen::Matrix3d R_head_rig = geometry::to_R_head_rig({g.yaw, g.pitch, g.roll}) * reading.R_rig_pano;
  head.R_head_rig = geometry::rows_of(R_head_rig);
  reading.positions.emplace_back(-(R_head_rig.transpose() * g.translation));
  NODAL_TRY(videostitch::set_lens(g.lens, head, result.notes));
  NODAL_TRY(finish_head(head, result.notes));
  NODAL_TRY_ASSIGN(const Photometry light, read_light(input, crop, reading));
  reading.light.push_back(light);
  return head;
}

/// [w, x, y, z], or a curve of such.
/// Errors: kBadValue.
Result<Eigen::Matrix3d> read_orientation(const JsonFields& pano, std::set<std::string>& changing) {
  constexpr const char* kKey = "global_orientation";
  if (!pano.has(kKey)) return Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  const json& q = videostitch::first_value(pano[kKey], kKey, changing);
  const auto bad = [&] {
    return fail(Errc::kBadValue, pano.where() + ": the field 'global_orientation' must be a quaternion or a curve");
  };
  if (!q.is_array() || q.size() != 4) return bad();
  Eigen::Vector4d v;
  for (Eigen::Index k = 0; k < 4; ++k) {
    const json& element = q[static_cast<std::size_t>(k)];
    if (!element.is_number()) return bad();
    v[k] = element.get<double>();
  }
  if (!v.allFinite() || v.norm() < 1e-6) return bad();
  v.normalize();
  return Eigen::Matrix3d(Eigen::Quaterniond(v[0], v[1], v[2], v[3]).toRotationMatrix());
}

/// Adds the points that VideoStitch's calibration matched; `head_of` maps an input to its head.
Status add_points(const JsonFields& pano, const std::vector<int>& head_of, ImportResult& result) {
  if (!pano.has("calibration_control_points")) return {};
  const JsonFields points(pano["calibration_control_points"], "calibration_control_points");
  if (!points.has("matched_control_points") || !points["matched_control_points"].is_array()) return {};
  for (const json& value : points["matched_control_points"]) {
    const JsonFields point(value, "matched_control_points");
    std::array<double, 6> n{};
    constexpr std::array kKeys{"input_index0", "x0", "y0", "input_index1", "x1", "y1"};
    for (std::size_t k = 0; k < kKeys.size(); ++k) {
      NODAL_TRY_ASSIGN(const double number, point.number(kKeys[k]));
      n[k] = number;
    }
    for (const std::size_t k : {std::size_t{0}, std::size_t{3}}) {
      const bool present = n[k] >= 0 && n[k] < static_cast<double>(head_of.size());
      if (present && head_of[static_cast<std::size_t>(n[k])] >= 0) continue;
      return fail(Errc::kBadValue,
                  "a matched control point is on input " + short_number(n[k]) + ", which is not there");
    }
    const auto head = [&](double input) { return static_cast<std::size_t>(head_of[static_cast<std::size_t>(input)]); };
    result.control_points.push_back({head(n[0]), {n[1] + 0.5, n[2] + 0.5}, head(n[3]), {n[4] + 0.5, n[5] + 0.5}});
  }
  return {};
}

/// The heads. Errors: those of the inputs; kUnsupported for too few or too many.
Status read_inputs(const json& inputs, Reading& reading) {
  ImportResult& result = reading.result;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const JsonFields input(inputs[i], fmt::format("input {}", i));
    reading.head_of.push_back(-1);
    if (is_false(input, "video_enabled")) continue;  // a microphone
    if (is_false(input, "enabled")) {
      result.notes.push_back(fmt::format("Input {} is switched off in the project: it is no head.", i));
      continue;
    }
    reading.head_of.back() = static_cast<int>(result.calibration.heads.size());
    NODAL_TRY_ASSIGN(HeadCalibration head, read_input(inputs[i], i, reading));
    see_input(inputs[i], input.where(), reading.check);
    result.calibration.heads.push_back(std::move(head));
    if (result.calibration.heads.size() > kMaxCalibratedHeads) break;
  }
  return check_head_count(result.calibration.heads.size());
}

/// Distance and positions. Errors: kBadValue.
Status set_places(const JsonFields& pano, Reading& reading) {
  double farthest = 0;
  for (const Eigen::Vector3d& position : reading.positions) farthest = std::max(farthest, position.norm());
  NODAL_TRY_ASSIGN(const double sphere, pano.number_or("spherescale", 0));
  if (farthest > 0 && sphere >= farthest * kMinDistancePerPosition && sphere <= kLongestDistance) {
    reading.result.calibration.distance = sphere;
  }
  set_positions(reading.positions, "the project's translations", reading.result);
  return {};
}

void tell_changing(const std::set<std::string>& changing, std::vector<std::string>& notes) {
  if (changing.empty()) return;
  std::string names;
  for (const std::string& name : changing) names += (names.empty() ? "'" : ", '") + name + "'";
  notes.push_back("Some fields change during the film (" + names + "): their first values are used.");
}

}  // namespace

Result<ImportResult> import_videostitch(std::string_view text, std::string_view name) {
  NODAL_TRY_ASSIGN(const json parsed, parse_foreign_json(text));
  // A whole project contains a "pano"; a file can also be the panorama itself.
  const JsonFields file(parsed, "the project");
  const bool whole = file.has("pano");
  const json& panorama = whole ? file["pano"] : parsed;
  const JsonFields pano(panorama, "the panorama");
  if (!pano.has("inputs") || !pano["inputs"].is_array()) {
    return fail(Errc::kMissingField, "there is no list 'inputs' in it: it is not a VideoStitch project");
  }
  Reading reading;
  ImportResult& result = reading.result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a VideoStitch project.";
  if (whole) see_members(parsed, "file", "", reading.check);
  see_members(panorama, "pano", "", reading.check);
  NODAL_TRY_ASSIGN(const Eigen::Matrix3d attitude, read_orientation(pano, reading.changing));
  reading.R_rig_pano = attitude;
  NODAL_TRY(read_inputs(pano["inputs"], reading));
  set_photometry(reading.light, result);
  NODAL_TRY(set_places(pano, reading));
  NODAL_TRY(add_points(pano, reading.head_of, result));
  tell_changing(reading.changing, result.notes);
  NODAL_TRY(reading.check.tell(result.notes));
  NODAL_TRY(check_calibration(result.calibration));
  return std::move(result);
}

}  // namespace nodal::interchange
