// Surround360's rig JSON, OpenCV's camera YAML and Kalibr's chain.
#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "protocol/base/try.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/export_heads.h"
#include "stitch/interchange/pinhole_lens.h"
#include "stitch/solve/normal_equations.h"

namespace nodal::interchange {
namespace {

constexpr double kFisheyeFrom = 75 * std::numbers::pi / 180;  // from the axis; a pinhole's numbers diverge beyond

std::string list(const std::vector<double>& values) {
  std::string text = "[";
  for (std::size_t k = 0; k < values.size(); ++k) text += (k == 0 ? "" : ", ") + exact(values[k]);
  return text + "]";
}

/// OpenCV's reader accepts "1e-05" as a number only if it contains a dot.
std::string yaml_real(double value) {
  std::string text = exact(value);
  if (text.find('.') != std::string::npos) return text;
  const std::size_t e = text.find('e');
  return e == std::string::npos ? text + "." : text.insert(e, ".");
}

struct Rational {
  double f = 0;
  std::vector<double> k;  // OpenCV's eight; the tangential ones are zero
};

/// OpenCV's rational model over the head's radii: f t (1 + k1 s + k2 s^2 + k3 s^3) = r (1 + k4 s + k5 s^2 + k6 s^3),
/// s = t^2; linear after division by the previous iteration's denominator (Sanathanan and Koerner).
Rational fit_rational(const SampledHead& head) {
  const geometry::Lens& lens = head.head.lens();
  Eigen::Matrix<double, 7, 1> x = Eigen::Matrix<double, 7, 1>::Zero();
  for (int pass = 0; pass < 12; ++pass) {
    solve::NormalEquations sum(7);
    constexpr int kRadii = 400;
    for (int i = 1; i <= kRadii; ++i) {
      const double a = head.farthest_angle * i / kRadii;
      const double t = std::tan(a), s = t * t;
      const double r = lens.radius(a).value_or(0);
      const double under = 1 + s * (x[4] + s * (x[5] + s * x[6]));
      Eigen::Matrix<double, 7, 1> row;
      row << t, t * s, t * s * s, t * s * s * s, -r * s, -r * s * s, -r * s * s * s;
      row /= under;
      // The weight grows with the radius, because there are more pixels farther out.
      sum.add(row.data(), -r / under, r);
    }
    constexpr double kDamping = 1e-13;  // powers of a tangent are nearly dependent: keeps pivots positive
    x = sum.step(kDamping, {});
  }
  return {x[0], {x[1] / x[0], x[2] / x[0], 0, 0, x[3] / x[0], x[4], x[5], x[6]}};
}

/// The residual of a rational lens, as a fit that tell_fit() can report.
PolynomialHead rational_residual(const SampledHead& head, const Rational& rational) {
  PolynomialHead fit;
  const PlumbBob bob{rational.k};
  const HeadCalibration& c = head.calibration();
  double square = 0;
  for (const geometry::RayPixel& sample : head.samples) {
    const Eigen::Vector2d bent = bob.bend(sample.ray.head<2>() / sample.ray.z());
    const double off = std::hypot(c.center_x + rational.f * bent.x() - sample.pixel.x,
                                  c.center_y + c.aspect * rational.f * bent.y() - sample.pixel.y);
    square += off * off;
    fit.max_px = std::max(fit.max_px, off);
  }
  fit.rms_px = std::sqrt(square / static_cast<double>(std::max<std::size_t>(1, head.samples.size())));
  return fit;
}

std::string matrix_text(const std::string& name, int rows, int columns, const std::vector<double>& values) {
  std::string data;
  for (std::size_t k = 0; k < values.size(); ++k) data += (k == 0 ? " " : ", ") + yaml_real(values[k]);
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [{} ]\n", name, rows, columns,
                     data);
}

Eigen::Vector3d position_of(const HeadCalibration& head) {
  return {head.position[0], head.position[1], head.position[2]};
}

/// Converts a direction of the rig (x right, y down, z forward) to a world with x forward, y left, z up.
std::vector<double> to_world(const Eigen::Vector3d& v) { return {v.z(), -v.x(), -v.y()}; }

}  // namespace

Status export_surround360(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result) {
  using Json = nlohmann::ordered_json;
  Json cameras = Json::array();
  for (const SampledHead& head : heads) {
    const HeadCalibration& c = head.calibration();
    NODAL_TRY_ASSIGN(const PolynomialHead fit,
                     best_fit(head, {RadialBasis::kAngle, RadialBasis::kTangent}, {1, 3, 5}, {true, true, false}));
    tell_fit(head, fit, "its lens fits the format's two distortion terms only nearly", result);
    const Eigen::Matrix3d R = geometry::matrix_of(c.R_head_rig);
    const double f = fit.coefficients[0];
    cameras.push_back({{"id", c.name},
                       {"type", fit.basis == RadialBasis::kTangent ? "RECTILINEAR" : "FTHETA"},
                       {"version", 1},
                       {"origin", to_world(position_of(c))},
                       {"right", to_world(R.row(0))},
                       {"up", to_world(-R.row(1))},
                       {"forward", to_world(R.row(2))},
                       {"resolution", {c.width, c.height}},
                       {"principal", {fit.cx, fit.cy}},
                       {"focal", {f, -f * fit.aspect}},
                       {"distortion", {fit.coefficients[1] / f, fit.coefficients[2] / f}},
                       {"fov", head.farthest_angle}});
  }
  tell_radiometry(calibration, false, result);
  result.notes.emplace_back(farthest_position(calibration) > 0
                                ? "Origins are in metres."
                                : "All cameras are written at the rig's middle (origin 0).");
  result.files.push_back({"", Json{{"cameras", cameras}}.dump(2) + "\n"});
  return {};
}

Status export_opencv(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result) {
  for (const SampledHead& head : heads) {
    const HeadCalibration& c = head.calibration();
    const bool fisheye = head.farthest_angle > kFisheyeFrom || std::holds_alternative<KannalaBrandtLens>(c.lens) ||
                         std::holds_alternative<EquidistantLens>(c.lens);
    double f = 0, cx = c.center_x, cy = c.center_y, aspect = c.aspect;
    std::vector<double> k;
    if (fisheye) {
      NODAL_TRY_ASSIGN(const PolynomialHead fit,
                       best_fit(head, {RadialBasis::kAngle}, {1, 3, 5, 7, 9}, {true, true, false}));
      tell_fit(head, fit, "its lens fits OpenCV's fisheye only nearly", result);
      f = fit.coefficients[0];
      cx = fit.cx;
      cy = fit.cy;
      aspect = fit.aspect;
      for (std::size_t i = 1; i < 5; ++i) k.push_back(fit.coefficients[i] / f);
    } else {
      const Rational rational = fit_rational(head);
      tell_fit(head, rational_residual(head, rational), "its lens fits OpenCV's rational model only nearly", result);
      f = rational.f;
      k = rational.k;
    }
    std::string text = "%YAML:1.0\n---\n# Head '" + c.name + "' of the rig '" + calibration.name + "', by Nodal.\n";
    text += fmt::format("image_width: {}\nimage_height: {}\ncamera_name: {}\nfisheye_model: {}\ndistortion_model: {}\n",
                        c.width, c.height, c.name, fisheye ? "1" : "0", fisheye ? "fisheye" : "rational_polynomial");
    text += matrix_text("camera_matrix", 3, 3, {f, 0, cx - 0.5, 0, f * aspect, cy - 0.5, 0, 0, 1});
    text += matrix_text("distortion_coefficients", static_cast<int>(k.size()), 1, k);
    text += matrix_text("R_head_rig", 3, 3, {c.R_head_rig.begin(), c.R_head_rig.end()});
    result.files.push_back({c.name, text});
  }
  tell_radiometry(calibration, false, result);
  return {};
}

Status export_kalibr(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result) {
  std::string text;
  Eigen::Matrix3d before = Eigen::Matrix3d::Identity();
  for (std::size_t n = 0; n < heads.size(); ++n) {
    const SampledHead& head = heads[n];
    const HeadCalibration& c = head.calibration();
    Result<PolynomialHead> fit = best_fit(head, {RadialBasis::kAngle}, {1, 3, 5, 7, 9}, {true, true, false});
    if (!fit) return fail(fit.error());
    const Result<PolynomialHead> radtan = best_fit(head, {RadialBasis::kTangent}, {1, 3, 5}, {true, true, false});
    const bool pinhole = radtan && radtan->rms_px <= fit->rms_px;
    if (pinhole) fit = radtan;
    tell_fit(head, *fit, "its lens fits Kalibr's distortions only nearly", result);
    const double f = fit->coefficients[0];
    std::vector<double> k;
    for (std::size_t i = 1; i < fit->coefficients.size(); ++i) k.push_back(fit->coefficients[i] / f);
    if (pinhole) k.resize(4, 0.0);  // p1, p2
    const Eigen::Matrix3d R = geometry::matrix_of(c.R_head_rig);
    const Eigen::Matrix3d step = R * before.transpose();
    text += fmt::format("cam{}:\n", n);
    if (n > 0) {
      text += "  T_cn_cnm1:\n";
      const Eigen::Vector3d shift = R * (position_of(calibration.heads[n - 1]) - position_of(c));
      for (Eigen::Index i = 0; i < 3; ++i) {
        text += "  - " + list({step(i, 0), step(i, 1), step(i, 2), shift[i]}) + "\n";
      }
      text += "  - [0, 0, 0, 1]\n";
    }
    text += fmt::format(
        "  camera_model: pinhole\n  distortion_model: {}\n  distortion_coeffs: {}\n  intrinsics: {}\n  resolution: "
        "[{}, {}]\n  rostopic: /{}/image_raw\n",
        pinhole ? "radtan" : "equidistant", list(k), list({f, f * fit->aspect, fit->cx - 0.5, fit->cy - 0.5}), c.width,
        c.height, c.name);
    before = R;
  }
  const Eigen::Matrix3d first = geometry::matrix_of(calibration.heads[0].R_head_rig);
  if ((first - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > 1e-9) {
    result.notes.push_back("A camera chain begins with the head '" + calibration.heads[0].name +
                           "': the rig is written as that head sees it, turned against the calibration.");
  }
  tell_radiometry(calibration, false, result);
  result.files.push_back({"", text});
  return {};
}

}  // namespace nodal::interchange
