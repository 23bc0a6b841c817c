#include "stitch/interchange/videostitch_lens.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "protocol/lens_range.h"
#include "stitch/interchange/foreign_head.h"

namespace nodal::interchange::videostitch {
namespace {

Result<Lens> read_projection(const JsonFields& input) {
  NODAL_TRY_ASSIGN(const std::string proj, input.text("proj"));
  Lens lens;
  lens.circle = proj.starts_with("circular_fisheye");
  if (proj == "rectilinear") {
    lens.basis = RadialBasis::kTangent;
  } else if (proj == "circular_fisheye_opt" || proj == "ff_fisheye_opt") {
    lens.basis = RadialBasis::kHalfTangent;
  } else if (proj != "circular_fisheye" && proj != "ff_fisheye") {
    return fail(Errc::kUnsupported, input.where() + ": its projection '" + proj +
                                        "' is no lens; rectilinear, ff_fisheye and circular_fisheye are");
  }
  return lens;
}

/// Every element of a curve that is an object is a value; a file may also hold one object.
const nlohmann::json* find_geometry(const nlohmann::json& geometries, std::size_t& values) {
  const nlohmann::json* first = nullptr;
  const auto take = [&](const nlohmann::json& element) {
    if (!element.is_object()) return;
    if (first == nullptr) first = &element;
    ++values;
  };
  take(geometries);
  if (!geometries.is_array()) return first;
  for (const nlohmann::json& element : geometries) {
    take(element);
    if (!element.is_array()) continue;
    for (const nlohmann::json& inner : element) take(inner);
  }
  return first;
}

/// The focal length of a field of view over `width`.
Result<double> focal_of(double fov, const Lens& lens, double width, const std::string& where) {
  const double most = lens.basis == RadialBasis::kTangent ? 180 : lens.basis == RadialBasis::kHalfTangent ? 360 : 720;
  if (!(fov > 0 && fov < most)) {
    return fail(Errc::kBadValue,
                fmt::format("{}: a horizontal field of view must be more than 0 and less than {} degrees", where,
                            static_cast<int>(most)));
  }
  const double a = fov * kRadiansPerDegree;
  switch (lens.basis) {
    case RadialBasis::kTangent: return width / 2 / std::tan(a / 2);
    case RadialBasis::kHalfTangent: return width / 2 / std::tan(a / 4);
    case RadialBasis::kAngle: break;
  }
  return width / a;
}

Status read_numbers(const JsonFields& fields, std::initializer_list<std::pair<const char*, double*>> names) {
  for (const auto& [key, value] : names) {
    NODAL_TRY_ASSIGN(const double number, fields.number_or(key, *value));
    *value = number;
  }
  return {};
}

Status set_focal(const JsonFields& fields, const char* old_fov, double width, Lens& lens) {
  const bool by_fov = !fields.has("horizontalFocal");
  const char* fov = fields.has("horizontalFov") || !fields.has(old_fov) ? "horizontalFov" : old_fov;
  if (by_fov && !fields.has(fov)) {
    return fail(Errc::kMissingField, fields.where() + ": there is neither 'horizontalFocal' nor 'horizontalFov'");
  }
  Result<double> fx = fields.number(by_fov ? fov : "horizontalFocal");
  if (fx && by_fov) fx = focal_of(*fx, lens, width, fields.where() + ": '" + fov + "'");
  if (!fx) return fail(fx.error());
  NODAL_TRY_ASSIGN(const double fy, fields.number_or("verticalFocal", *fx));
  lens.fx = *fx;
  lens.fy = fy > 0 ? fy : *fx;
  if (lens.fx >= 1 && lens.fx <= 1e6 && lens.fy <= 1e6) return {};
  return fail(Errc::kBadValue, fields.where() + ": 'horizontalFocal' and 'verticalFocal' must be 1 to 1000000 px");
}

/// The fields that projects before 'geometries' have in the input itself.
Result<Geometry> read_old_geometry(const JsonFields& input, const Crop& crop, Geometry g) {
  if (!input.has("hfov")) {
    return fail(Errc::kMissingField, input.where() + ": there are no 'geometries', and no 'hfov' of an old project");
  }
  NODAL_TRY(read_numbers(input, {{"yaw", &g.yaw},
                                 {"pitch", &g.pitch},
                                 {"roll", &g.roll},
                                 {"dist_center_x", &g.center_x},
                                 {"dist_center_y", &g.center_y},
                                 {"lens_dist_a", &g.lens.a},
                                 {"lens_dist_b", &g.lens.b},
                                 {"lens_dist_c", &g.lens.c}}));
  NODAL_TRY(set_focal(input, "hfov", crop.right - crop.left, g.lens));
  return g;
}

/// The point where a ray of the head falls, relative to the lens's centre.
Eigen::Vector2d project(const Lens& lens, const Eigen::Vector3d& ray) {
  const double s = std::hypot(ray.x(), ray.y());
  if (s == 0) return {0, 0};
  const double t = radial_basis(lens.basis, std::atan2(s, ray.z()));
  Eigen::Vector2d p(t * ray.x() / s, t * ray.y() / s);
  const auto bent = [&](const Eigen::Vector2d& q, double unit) {
    const double r = q.norm() / unit, x = q.x(), y = q.y(), s2 = q.squaredNorm();
    const auto& [p1, p2] = lens.tangential;
    const auto& [s1, s2x, s3, s4] = lens.prism;
    const double radial = 1 - lens.a - lens.b - lens.c + r * (lens.c + r * (lens.b + r * lens.a));
    return Eigen::Vector2d(x * radial + 2 * p1 * x * y + p2 * (s2 + 2 * x * x) + s2 * (s1 + s2 * s2x),
                           y * radial + p1 * (s2 + 2 * y * y) + 2 * p2 * x * y + s2 * (s3 + s2 * s4));
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

}  // namespace

bool Lens::radial_only() const {
  const auto none = [](double k) { return k == 0; };
  return std::ranges::all_of(tangential, none) && std::ranges::all_of(prism, none);
}

const nlohmann::json& first_value(const nlohmann::json& curve, std::string_view name, std::set<std::string>& changing) {
  constexpr std::size_t kEach = 3;  // type, frame, value
  if (!curve.is_array() || curve.empty() || curve.size() % kEach != 0 || !curve[1].is_number()) return curve;
  if (curve.size() > kEach) changing.emplace(name);
  return curve[kEach - 1];
}

Result<Geometry> read_geometry(const JsonFields& input, const Crop& crop, std::set<std::string>& changing,
                               FieldCheck& check) {
  NODAL_TRY_ASSIGN(Lens lens, read_projection(input));
  Geometry g;
  g.lens = lens;
  g.lens.meters = input.has("useMeterDistortion") && input["useMeterDistortion"] == true;
  g.lens.unit = std::min(crop.right - crop.left, crop.bottom - crop.top) / 2;
  std::size_t values = 0;
  const nlohmann::json* found = input.has("geometries") ? find_geometry(input["geometries"], values) : nullptr;
  if (found == nullptr) return read_old_geometry(input, crop, g);
  if (values > 1) changing.insert("geometries");
  const JsonFields fields(*found, input.where() + ": geometries");
  see_members(*found, "geometry", input.where(), check);
  Status read = read_numbers(fields, {{"yaw", &g.yaw},
                                      {"pitch", &g.pitch},
                                      {"roll", &g.roll},
                                      {"center_x", &g.center_x},
                                      {"center_y", &g.center_y},
                                      {"distort_a", &g.lens.a},
                                      {"distort_b", &g.lens.b},
                                      {"distort_c", &g.lens.c}});
  if (!read) return fail(read.error());
  read = read_numbers(fields, {{"translation_x", &g.translation.x()},
                               {"translation_y", &g.translation.y()},
                               {"translation_z", &g.translation.z()},
                               {"distort_p1", g.lens.tangential.data()},
                               {"distort_p2", &g.lens.tangential[1]},
                               {"distort_s1", g.lens.prism.data()},
                               {"distort_s2", &g.lens.prism[1]},
                               {"distort_s3", &g.lens.prism[2]},
                               {"distort_s4", &g.lens.prism[3]}});
  if (!read) return fail(read.error());
  NODAL_TRY(set_focal(fields, "hfov", crop.right - crop.left, g.lens));
  return g;
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
  // Tangential terms are mostly a shift of the centre and a rotation of the head.
  const bool other = !lens.radial_only();
  const Result<PolynomialHead> fit = fit_polynomial_head(samples, start, {other, other || !lens.meters, other});
  if (!fit) return fail(fit.error().in("head '" + head.name + "'"));
  take_fit(*fit,
           other ? "its tangential or prism distortion has no counterpart here"
                 : "its stereographic lens, or a polynomial over pixels that are not square, has no exact counterpart",
           head, notes);
  return {};
}

}  // namespace nodal::interchange::videostitch
