// VideoStitch's project (.ptv), interpreted as by stitchEm: JSON, focal lengths in px, the Panorama Tools polynomial.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/base/angles.h"
#include "protocol/lens_range.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/json_fields.h"
#include "stitch/interchange/panotools_head.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

/// One input's lens with the file's numbers.
struct Lens {
  RadialBasis basis = RadialBasis::kAngle;
  bool circle = false;
  double fx = 0, fy = 0;
  double a = 0, b = 0, c = 0;
  bool meters = false;  ///< the polynomial is applied before the focal length, not after
  double unit = 1;      ///< px; half the shorter side
};

Result<Lens> read_projection(const JsonFields& input) {
  const Result<std::string> proj = input.text("proj");
  if (!proj) return fail(proj.error());
  Lens lens;
  lens.circle = proj->starts_with("circular_fisheye");
  if (*proj == "rectilinear") {
    lens.basis = RadialBasis::kTangent;
  } else if (*proj == "circular_fisheye_opt" || *proj == "ff_fisheye_opt") {
    lens.basis = RadialBasis::kHalfTangent;
  } else if (*proj != "circular_fisheye" && *proj != "ff_fisheye") {
    return fail(Errc::kUnsupported, input.where() + ": its projection '" + *proj +
                                        "' is no lens; rectilinear, ff_fisheye and circular_fisheye are");
  }
  return lens;
}

/// A curve over time holds its first value before the last element: [frame, 0, {...}] or {...}.
const nlohmann::json* find_geometry(const JsonFields& input) {
  if (!input.has("geometries")) return nullptr;
  const nlohmann::json& geometries = input["geometries"];
  if (geometries.is_object()) return &geometries;
  if (!geometries.is_array()) return nullptr;
  for (const nlohmann::json& element : geometries) {
    if (element.is_object()) return &element;
    if (!element.is_array()) continue;
    for (const nlohmann::json& inner : element) {
      if (inner.is_object()) return &inner;
    }
  }
  return nullptr;
}

struct Numbers {
  double yaw = 0, pitch = 0, roll = 0, center_x = 0, center_y = 0;
  /// m: with its rotation R and the sphere's radius s, the head sees s R ray + translation.
  Eigen::Vector3d translation{0, 0, 0};
};

Result<Numbers> read_numbers(const JsonFields& geometry, Lens& lens) {
  Numbers n;
  const std::array<std::pair<const char*, double*>, 11> fields{{{"yaw", &n.yaw},
                                                                {"pitch", &n.pitch},
                                                                {"roll", &n.roll},
                                                                {"center_x", &n.center_x},
                                                                {"center_y", &n.center_y},
                                                                {"distort_a", &lens.a},
                                                                {"distort_b", &lens.b},
                                                                {"distort_c", &lens.c},
                                                                {"translation_x", &n.translation.x()},
                                                                {"translation_y", &n.translation.y()},
                                                                {"translation_z", &n.translation.z()}}};
  for (const auto& [key, value] : fields) {
    const Result<double> number = geometry.number_or(key, 0);
    if (!number) return fail(number.error());
    *value = *number;
  }
  const Result<double> fx = geometry.number("horizontalFocal");
  if (!fx) return fail(fx.error());
  const Result<double> fy = geometry.number_or("verticalFocal", *fx);
  if (!fy) return fail(fy.error());
  lens.fx = *fx;
  lens.fy = *fy > 0 ? *fy : *fx;
  if (!(lens.fx >= 1 && lens.fx <= 1e6 && lens.fy <= 1e6)) {
    return fail(Errc::kBadValue, geometry.where() + ": 'horizontalFocal' and 'verticalFocal' must be 1 to 1000000 px");
  }
  return n;
}

/// The point where a ray of the head falls, relative to the lens's centre.
Eigen::Vector2d project(const Lens& lens, const Eigen::Vector3d& ray) {
  const double s = std::hypot(ray.x(), ray.y());
  if (s == 0) return {0, 0};
  const double t = radial_basis(lens.basis, std::atan2(s, ray.z()));
  Eigen::Vector2d p(t * ray.x() / s, t * ray.y() / s);
  const auto bent = [&](const Eigen::Vector2d& q, double unit) {
    const double r = q.norm() / unit;
    return Eigen::Vector2d(q * (1 - lens.a - lens.b - lens.c + r * (lens.c + r * (lens.b + r * lens.a))));
  };
  if (lens.meters) p = bent(p, 1);
  p = {p.x() * lens.fx, p.y() * lens.fy};
  if (!lens.meters) p = bent(p, lens.unit);
  return p;
}

/// The angle up to which the projection rises and stays within `radius_px` on the x axis.
double end_of(const Lens& lens, double radius_px) {
  const double most = lens.basis == RadialBasis::kTangent ? 89 * kPi / 180 : 170 * kPi / 180;
  double last = 0;
  for (double a = 0.005; a < most; a += 0.005) {
    const double r = project(lens, {std::sin(a), 0, std::cos(a)}).x();
    if (r <= last || r > radius_px) return a - 0.005;
    last = r;
  }
  return most;
}

Status set_lens(const Lens& lens, HeadCalibration& head, std::vector<std::string>& notes) {
  const double end = end_of(lens, farthest_radius(head.region, head.center_x, head.center_y, lens.fy / lens.fx));
  std::vector<geometry::RayPixel> samples;
  for (int i = 1; i <= 60; ++i) {
    for (int k = 0; k < 24; ++k) {
      const double a = end * i / 60;
      const double turn = 2 * kPi * k / 24;
      const Eigen::Vector3d ray(std::sin(a) * std::cos(turn), std::sin(a) * std::sin(turn), std::cos(a));
      const Eigen::Vector2d p = project(lens, ray);
      samples.push_back({ray, {head.center_x + p.x(), head.center_y + p.y()}});
    }
  }
  // The Panorama Tools polynomial of an angle or tangent is a lens of the document; of half tangents it is fitted.
  PolynomialHead start;
  start.basis = lens.basis == RadialBasis::kTangent ? RadialBasis::kTangent : RadialBasis::kAngle;
  start.exponents = lens.basis == RadialBasis::kHalfTangent ? std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9}
                                                            : std::vector<int>{1, 2, 3, 4};
  start.cx = head.center_x;
  start.cy = head.center_y;
  start.aspect = lens.fy / lens.fx;
  const Result<PolynomialHead> fit = fit_polynomial_head(samples, start, {false, !lens.meters, false});
  if (!fit) return fail(fit.error().in("head '" + head.name + "'"));
  take_fit(*fit, "its stereographic lens, or a polynomial over pixels that are not square, has no exact counterpart",
           head, notes);
  return {};
}

Result<HeadCalibration> read_input(const nlohmann::json& json, std::size_t index, const Eigen::Matrix3d& R_rig_pano,
                                   ImportResult& result, std::vector<Eigen::Vector3d>& positions) {
  const JsonFields input(json, "input " + std::to_string(index));
  const Result<int> width = input.side("width");
  if (!width) return fail(width.error());
  const Result<int> height = input.side("height");
  if (!height) return fail(height.error());
  std::string file;
  if (input.has("reader_config") && input["reader_config"].is_string()) {
    file = input["reader_config"].get<std::string>();
  }
  std::vector<std::string> taken;
  for (const HeadCalibration& head : result.calibration.heads) taken.push_back(head.name);
  HeadCalibration head = blank_head(head_name(file, taken), *width, *height);
  result.images.push_back(file);

  Result<Lens> lens = read_projection(input);
  if (!lens) return fail(lens.error());
  const nlohmann::json* geometry = find_geometry(input);
  if (geometry == nullptr) return fail(Errc::kMissingField, input.where() + ": there are no 'geometries'");
  const Result<Numbers> numbers = read_numbers(JsonFields(*geometry, input.where() + ": geometries"), *lens);
  if (!numbers) return fail(numbers.error());
  lens->meters = input.has("useMeterDistortion") && input["useMeterDistortion"].is_boolean() &&
                 input["useMeterDistortion"].get<bool>();

  Crop crop{0, static_cast<double>(*width), 0, static_cast<double>(*height)};
  const std::array<std::pair<const char*, double*>, 4> edges{
      {{"crop_left", &crop.left}, {"crop_right", &crop.right}, {"crop_top", &crop.top}, {"crop_bottom", &crop.bottom}}};
  for (const auto& [key, value] : edges) {
    const Result<double> edge = input.number_or(key, *value);
    if (!edge) return fail(edge.error());
    *value = *edge;
  }
  if (!(crop.left < crop.right && crop.top < crop.bottom)) {
    return fail(Errc::kBadValue, input.where() + ": its crop has no area");
  }
  lens->unit = std::min(crop.right - crop.left, crop.bottom - crop.top) / 2;
  head.center_x = (crop.left + crop.right) / 2 + numbers->center_x;
  head.center_y = (crop.top + crop.bottom) / 2 + numbers->center_y;
  head.region.left = std::clamp(crop.left, 0.0, head.region.right);
  head.region.right = std::clamp(crop.right, 0.0, head.region.right);
  head.region.top = std::clamp(crop.top, 0.0, head.region.bottom);
  head.region.bottom = std::clamp(crop.bottom, 0.0, head.region.bottom);
  if (lens->circle) {
    head.region.circle = {(crop.left + crop.right) / 2, (crop.top + crop.bottom) / 2, lens->unit};
  }
  const Eigen::Matrix3d R_head_rig =
      geometry::to_R_head_rig({numbers->yaw, numbers->pitch, numbers->roll}) * R_rig_pano;
  head.R_head_rig = geometry::rows_of(R_head_rig);
  positions.emplace_back(-(R_head_rig.transpose() * numbers->translation));
  if (Status s = set_lens(*lens, head, result.notes); !s) return fail(s.error());
  const Result<double> ev = input.number_or("ev", 0);
  if (ev && std::abs(*ev) < 20) head.gain.fill(std::exp2(-*ev));
  if (Status s = finish_head(head, result.notes); !s) return fail(s.error());
  return head;
}

/// [w, x, y, z], or a curve whose last element is one.
Eigen::Matrix3d read_orientation(const JsonFields& pano) {
  if (!pano.has("global_orientation")) return Eigen::Matrix3d::Identity();
  const nlohmann::json* q = &pano["global_orientation"];
  if (q->is_array() && !q->empty() && q->back().is_array()) q = &q->back();
  if (!q->is_array() || q->size() != 4) return Eigen::Matrix3d::Identity();
  Eigen::Vector4d v;
  for (Eigen::Index k = 0; k < 4; ++k) {
    const nlohmann::json& element = (*q)[static_cast<std::size_t>(k)];
    if (!element.is_number()) return Eigen::Matrix3d::Identity();
    v[k] = element.get<double>();
  }
  if (!v.allFinite() || v.norm() < 1e-6) return Eigen::Matrix3d::Identity();
  v.normalize();
  return Eigen::Quaterniond(v[0], v[1], v[2], v[3]).toRotationMatrix();
}

/// Adds the points that VideoStitch's calibration matched; `head_of` maps an input to its head.
Status add_points(const JsonFields& pano, const std::vector<int>& head_of, ImportResult& result) {
  if (!pano.has("calibration_control_points")) return {};
  const JsonFields points(pano["calibration_control_points"], "calibration_control_points");
  if (!points.has("matched_control_points") || !points["matched_control_points"].is_array()) return {};
  for (const nlohmann::json& json : points["matched_control_points"]) {
    const JsonFields point(json, "matched_control_points");
    std::array<double, 6> n{};
    constexpr std::array kKeys{"input_index0", "x0", "y0", "input_index1", "x1", "y1"};
    for (std::size_t k = 0; k < kKeys.size(); ++k) {
      const Result<double> number = point.number(kKeys[k]);
      if (!number) return fail(number.error());
      n[k] = *number;
    }
    for (const std::size_t k : {std::size_t{0}, std::size_t{3}}) {
      const bool there = n[k] >= 0 && n[k] < static_cast<double>(head_of.size());
      if (there && head_of[static_cast<std::size_t>(n[k])] >= 0) continue;
      return fail(Errc::kBadValue,
                  "a matched control point is on input " + short_number(n[k]) + ", which is not there");
    }
    const auto head = [&](double input) { return static_cast<std::size_t>(head_of[static_cast<std::size_t>(input)]); };
    result.control_points.push_back({head(n[0]), {n[1] + 0.5, n[2] + 0.5}, head(n[3]), {n[4] + 0.5, n[5] + 0.5}});
  }
  return {};
}

}  // namespace

Result<ImportResult> import_videostitch(std::string_view text, std::string_view name) {
  const Result<nlohmann::json> json = parse_foreign_json(text);
  if (!json) return fail(json.error());
  // A whole project contains a "pano"; a file can also be the panorama itself.
  const JsonFields file(*json, "the project");
  const JsonFields pano(file.has("pano") ? file["pano"] : *json, "the panorama");
  if (!pano.has("inputs") || !pano["inputs"].is_array()) {
    return fail(Errc::kMissingField, "there is no list 'inputs' in it: it is not a VideoStitch project");
  }
  const nlohmann::json& inputs = pano["inputs"];
  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a VideoStitch project.";
  const Eigen::Matrix3d R_rig_pano = read_orientation(pano);
  std::vector<Eigen::Vector3d> positions;
  bool response = false;
  std::vector<int> head_of;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const JsonFields input(inputs[i], "input");
    head_of.push_back(-1);
    if (input.has("video_enabled") && input["video_enabled"] == false) continue;  // a microphone
    head_of.back() = static_cast<int>(result.calibration.heads.size());
    Result<HeadCalibration> head = read_input(inputs[i], i, R_rig_pano, result, positions);
    if (!head) return fail(head.error());
    result.calibration.heads.push_back(std::move(*head));
    for (const char* key : {"emor_a", "vign_b", "vign_c", "vign_d"}) {
      const Result<double> value = input.number_or(key, 0);
      response = response || (value && *value != 0);
    }
  }
  if (Status s = check_head_count(result.calibration.heads.size()); !s) return fail(s.error());
  double mean = 0;
  for (const HeadCalibration& head : result.calibration.heads) {
    mean += std::log(head.gain[0]) / static_cast<double>(result.calibration.heads.size());
  }
  for (HeadCalibration& head : result.calibration.heads) {
    for (double& gain : head.gain) gain *= std::exp(-mean);
  }
  double farthest = 0;
  for (const Eigen::Vector3d& position : positions) farthest = std::max(farthest, position.norm());
  const Result<double> sphere = pano.number_or("spherescale", 0);
  if (farthest > 0 && sphere && *sphere >= farthest * kLeastDistancePerPosition && *sphere <= kLongestDistance) {
    result.calibration.distance = *sphere;
  }
  set_positions(positions, "the project's translations", result);
  if (response) {
    result.notes.push_back("Its response curve and vignetting (emor_, vign_) belong to each other and are left out.");
  }
  if (Status s = add_points(pano, head_of, result); !s) return fail(s.error());
  if (Status s = check_calibration(result.calibration); !s) return fail(s.error());
  return result;
}

}  // namespace nodal::interchange
