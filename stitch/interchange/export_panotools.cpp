// Hugin's .pto, PTGui's text .pts and VideoStitch's .ptv: all three use the Panorama Tools polynomial
//   r = N (a p^4 + b p^3 + c p^2 + (1 - a - b - c) p),  p = ideal radius / N.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/export_heads.h"
#include "stitch/interchange/panotools_masks.h"

namespace nodal::interchange {
namespace {

constexpr const char* kNoAspect = "its lens, or pixels that are not square, fit the format's polynomial only nearly";

/// A fourth-degree polynomial in the basis, written as focal length and a, b, c for the radius N.
struct Panotools {
  double f = 0, a = 0, b = 0, c = 0;
};

/// The focal length is the one for which the polynomial maps N to itself: r(N / f) = N.
Panotools panotools_of(const PolynomialHead& fit, double N) {
  const auto radius = [&](double t) {
    double r = 0;
    for (std::size_t k = fit.coefficients.size(); k > 0; --k) r = (r + fit.coefficients[k - 1]) * t;
    return r;
  };
  double low = 0, high = 1e-3;
  while (radius(high) < N && high < 1e3) high *= 1.5;
  for (int n = 0; n < 200; ++n) (radius((low + high) / 2) < N ? low : high) = (low + high) / 2;
  const double f = N / ((low + high) / 2);
  return {f, fit.coefficients[3] * N * N * N / (f * f * f * f), fit.coefficients[2] * N * N / (f * f * f),
          fit.coefficients[1] * N / (f * f)};
}

struct Written {
  PolynomialHead fit;
  Panotools numbers;
  bool rectilinear = false;
  double hfov = 0;  ///< degrees
  geometry::YawPitchRoll turn;
};

/// The numbers that .pto and .pts hold for a head, for a rectangle of `width` x `height` px.
Result<Written> written_head(const SampledHead& head, double width, double height) {
  NODAL_TRY_ASSIGN(PolynomialHead fit,
                   best_fit(head, {RadialBasis::kAngle, RadialBasis::kTangent}, {1, 2, 3, 4}, {true, false, false}));
  Written written;
  written.rectilinear = fit.basis == RadialBasis::kTangent;
  written.numbers = panotools_of(fit, std::min(width, height) / 2);
  const double f = written.numbers.f;
  written.hfov = (written.rectilinear ? 2 * std::atan(width / 2 / f) : width / f) / kRadiansPerDegree;
  written.turn = geometry::to_yaw_pitch_roll(geometry::matrix_of(head.calibration().R_head_rig));
  written.fit = std::move(fit);
  return written;
}

std::string lens_numbers(const Written& w) {
  return " v" + exact(w.hfov) + " a" + exact(w.numbers.a) + " b" + exact(w.numbers.b) + " c" + exact(w.numbers.c);
}

std::string pose_numbers(const Written& w) {
  return " y" + exact(w.turn.yaw) + " p" + exact(w.turn.pitch) + " r" + exact(w.turn.roll);
}

std::string whole(double value) { return std::to_string(std::lround(value)); }

}  // namespace

Status export_hugin(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result) {
  std::string text =
      "# hugin project file\n#hugin_ptoversion 2\n"
      "p f2 w4096 h2048 v360 E0 R0 n\"TIFF_m c:LZW r:CROP\"\nm g1 i0 m2 p0.00784314\n";
  for (const SampledHead& head : heads) {
    const HeadCalibration& c = head.calibration();
    const double width = c.width, height = c.height;
    NODAL_TRY_ASSIGN(const Written w, written_head(head, width, height));
    tell_fit(head, w.fit, kNoAspect, result);
    const bool circle = c.region.circle.has_value();
    text += fmt::format("i w{} h{} f{}{} d{} e{} g0 t0{}", c.width, c.height,
                        w.rectilinear ? "0"
                        : circle      ? "2"
                                      : "3",
                        lens_numbers(w), exact(w.fit.cx - width / 2), exact(w.fit.cy - height / 2), pose_numbers(w));
    // Our V is a function of radius^2 in units of its own radius; Hugin's, in units of half the diagonal.
    const double scale = std::pow(std::hypot(width, height) / 2 / c.vignetting.radius, 2);
    const auto& v = c.vignetting.coefficients;
    text += " Va1 Vb" + exact(v[0] * scale) + " Vc" + exact(v[1] * scale * scale) + " Vd" +
            exact(v[2] * scale * scale * scale) + " Vx" + exact(c.vignetting.x - width / 2) + " Vy" +
            exact(c.vignetting.y - height / 2) + " Vm5 Eev" + exact(-std::log2(c.gain[1])) + " Er" +
            exact(c.gain[0] / c.gain[1]) + " Eb" + exact(c.gain[2] / c.gain[1]) + " Ra0 Rb0 Rc0 Rd0 Re0";
    if (circle && !w.rectilinear) {
      const Region::Circle& r = *c.region.circle;
      text += " S" + whole(r.x - r.radius) + "," + whole(r.x + r.radius) + "," + whole(r.y - r.radius) + "," +
              whole(r.y + r.radius);
    } else if (c.region.left > 0 || c.region.top > 0 || c.region.right < width || c.region.bottom < height) {
      text += " S" + whole(c.region.left) + "," + whole(c.region.right) + "," + whole(c.region.top) + "," +
              whole(c.region.bottom);
    }
    text += " n\"" + head.image + "\"\n";
  }
  for (std::size_t h = 0; h < heads.size(); ++h) text += mask_lines(heads[h].calibration().region, h);
  tell_aspect(heads, result);
  tell_radiometry(calibration, true, result);
  result.files.push_back({"", text + "\nv\n"});
  return {};
}

Status export_ptgui(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result) {
  std::string text =
      "# ptGui project file\n\n#-fileversion 14\n# Panorama settings:\n"
      "p w4096 h2048 f2 v360 u0 n\"JPEG g0 q95\"\nm g0 i0\n\n# input images:\n"
      "#-dummyimage\no w1 h1 y0 r0 p0 v90 a0 b0 c0 f2 d0 e0 g0 t0\n";
  for (const SampledHead& head : heads) {
    const HeadCalibration& c = head.calibration();
    const Region& region = c.region;
    // The crop is a square around the circle, or the region, in whole pixels; lens and centre refer to it.
    double left = std::round(region.left), right = std::round(region.right);
    double top = std::round(region.top), bottom = std::round(region.bottom);
    if (region.circle) {
      left = std::round(region.circle->x - region.circle->radius);
      top = std::round(region.circle->y - region.circle->radius);
      right = left + std::round(2 * region.circle->radius);
      bottom = top + std::round(2 * region.circle->radius);
    }
    NODAL_TRY_ASSIGN(const Written w, written_head(head, right - left, bottom - top));
    tell_fit(head, w.fit, kNoAspect, result);
    text += fmt::format("#-imgfile {} {} \"{}\"\no f{}{}{} d{} e{} g0 t0 C{},{},{},{}\n", c.width, c.height, head.image,
                        w.rectilinear   ? "0"
                        : region.circle ? "2"
                                        : "3",
                        pose_numbers(w), lens_numbers(w), exact(w.fit.cx - (left + right) / 2),
                        exact(w.fit.cy - (top + bottom) / 2), whole(left), whole(right), whole(top), whole(bottom));
  }
  tell_aspect(heads, result);
  tell_radiometry(calibration, false, result);
  result.files.push_back({"", text + "\n# Control points:\n"});
  return {};
}

Status export_videostitch(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result) {
  using Json = nlohmann::ordered_json;
  Json inputs = Json::array();
  for (const SampledHead& head : heads) {
    const HeadCalibration& c = head.calibration();
    NODAL_TRY_ASSIGN(const PolynomialHead fit,
                     best_fit(head, {RadialBasis::kAngle, RadialBasis::kTangent}, {1, 2, 3, 4}, {true, true, false}));
    tell_fit(head, fit, "its lens fits the format's polynomial only nearly", result);
    // With "useMeterDistortion" the polynomial's unit is 1 (a radian, a tangent of 1); pixels need not be square.
    const Panotools n = [&] {
      double f = 0;
      for (const double k : fit.coefficients) f += k;
      return Panotools{f, fit.coefficients[3] / f, fit.coefficients[2] / f, fit.coefficients[1] / f};
    }();
    const bool rectilinear = fit.basis == RadialBasis::kTangent;
    const Region& region = c.region;
    double left = region.left, right = region.right, top = region.top, bottom = region.bottom;
    if (region.circle) {
      left = region.circle->x - region.circle->radius;
      right = region.circle->x + region.circle->radius;
      top = region.circle->y - region.circle->radius;
      bottom = region.circle->y + region.circle->radius;
    }
    left = std::round(left), right = std::round(right), top = std::round(top), bottom = std::round(bottom);
    const geometry::YawPitchRoll turn = geometry::to_yaw_pitch_roll(geometry::matrix_of(c.R_head_rig));
    Json geometry{{"yaw", turn.yaw},
                  {"pitch", turn.pitch},
                  {"roll", turn.roll},
                  {"center_x", fit.cx - (left + right) / 2},
                  {"center_y", fit.cy - (top + bottom) / 2},
                  {"distort_a", n.a},
                  {"distort_b", n.b},
                  {"distort_c", n.c},
                  {"horizontalFocal", n.f},
                  {"verticalFocal", n.f * fit.aspect}};
    inputs.push_back({{"reader_config", head.image},
                      {"width", c.width},
                      {"height", c.height},
                      {"proj", rectilinear     ? "rectilinear"
                               : region.circle ? "circular_fisheye"
                                               : "ff_fisheye"},
                      {"crop_left", static_cast<long>(left)},
                      {"crop_right", static_cast<long>(right)},
                      {"crop_top", static_cast<long>(top)},
                      {"crop_bottom", static_cast<long>(bottom)},
                      {"useMeterDistortion", true},
                      {"ev", -std::log2(c.gain[1])},
                      {"response", "linear"},
                      {"geometries", Json::array({0, 0, geometry})},
                      {"video_enabled", true},
                      {"audio_enabled", false}});
  }
  Json project{{"pano",
                {{"width", 4096},
                 {"height", 2048},
                 {"hfov", 360},
                 {"proj", "equirectangular"},
                 {"global_orientation", {1, 0, 0, 0}},
                 {"inputs", inputs}}}};
  tell_radiometry(calibration, false, result);
  result.files.push_back({"", project.dump(2) + "\n"});
  return {};
}

}  // namespace nodal::interchange
