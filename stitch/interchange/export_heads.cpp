#include "stitch/interchange/export_heads.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

#include "protocol/base/try.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

constexpr double kTellExportPx = 0.01;
constexpr double kSquare = 1e-6;
constexpr double kTangentEnds = 85 * std::numbers::pi / 180;

/// The same head for a picture resampled to square pixels: wider for aspects above 1, higher below.
HeadCalibration resampled(const HeadCalibration& head, ExportResult& result) {
  HeadCalibration square = head;
  const bool wider = head.aspect > 1;
  const int width = wider ? static_cast<int>(std::lround(head.width * head.aspect)) : head.width;
  const int height = wider ? head.height : static_cast<int>(std::lround(head.height / head.aspect));
  const double sx = static_cast<double>(width) / head.width;
  const double sy = static_cast<double>(height) / head.height;
  square.width = width;
  square.height = height;
  square.center_x *= sx;
  square.center_y *= sy;
  square.region.left *= sx;
  square.region.right *= sx;
  square.region.top *= sy;
  square.region.bottom *= sy;
  square.vignetting.x *= sx;
  square.vignetting.y *= sy;
  if (square.region.circle) {
    square.region.circle->x *= sx;
    square.region.circle->y *= sy;
    square.region.circle->radius *= std::min(sx, sy);
  }
  for (auto& mask : square.region.masks) {
    for (Region::Point& corner : mask) corner = {corner.x * sx, corner.y * sy};
  }
  // Radii are measured along x, so the lens grows with the width; the aspect keeps the rounding of the new size.
  square.aspect = head.aspect * sy / sx;
  square.vignetting.radius *= sx;
  std::visit(
      [sx](auto& lens) {
        using Lens = std::decay_t<decltype(lens)>;
        if constexpr (std::is_same_v<Lens, TsaiLens>) {
          lens.focal *= sx;
          lens.kappa1 /= sx * sx;
          lens.kappa2 /= sx * sx * sx * sx;
        } else if constexpr (std::is_same_v<Lens, KannalaBrandtLens>) {
          lens.focal *= sx;
        } else {
          for (double& c : lens.coefficients) c *= sx;
        }
      },
      square.lens);
  result.notes.push_back(fmt::format(
      "The numbers of head '{}' are for its picture resampled to {}x{} px (ffmpeg -i IN -vf scale={}:{} OUT).",
      head.name, width, height, width, height));
  return square;
}

}  // namespace

std::string exact(double value) {
  std::array<char, 32> text;
  if (value == 0) value = 0;  // no "-0"
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end};
}

Result<std::vector<SampledHead>> sampled_heads(const Calibration& calibration, const ExportOptions& options,
                                               ExportResult& result) {
  std::vector<SampledHead> heads;
  for (std::size_t i = 0; i < calibration.heads.size(); ++i) {
    const HeadCalibration& head = calibration.heads[i];
    const bool resample = options.square_pixels && std::abs(head.aspect - 1) > kSquare;
    NODAL_TRY_ASSIGN(geometry::Head made, geometry::Head::make(resample ? resampled(head, result) : head));
    SampledHead sampled{std::move(made), {}, 0, head.name + ".jpg"};
    if (i < options.images.size() && !options.images[i].empty()) sampled.image = options.images[i];
    sampled.samples = geometry::sample_head(sampled.head);
    for (const geometry::RayPixel& s : sampled.samples) {
      const double angle = std::atan2(std::hypot(s.ray.x(), s.ray.y()), s.ray.z());
      sampled.farthest_angle = std::max(sampled.farthest_angle, angle);
    }
    heads.push_back(std::move(sampled));
  }
  return heads;
}

Result<PolynomialHead> best_fit(const SampledHead& head, const std::vector<RadialBasis>& bases,
                                const std::vector<int>& exponents, const FitFreedom& freedom) {
  Result<PolynomialHead> best =
      fail(Errc::kUnsupported, "head '" + head.calibration().name + "': its lens sees " +
                                   short_number(head.farthest_angle * 180 / std::numbers::pi) +
                                   " degrees from its axis, which this format's lenses cannot; choose another format");
  for (const RadialBasis basis : bases) {
    if (basis == RadialBasis::kTangent && head.farthest_angle > kTangentEnds) continue;
    PolynomialHead start;
    start.basis = basis;
    start.exponents = exponents;
    start.cx = head.calibration().center_x;
    start.cy = head.calibration().center_y;
    start.aspect = freedom.aspect ? head.calibration().aspect : 1;
    Result<PolynomialHead> fit = fit_polynomial_head(head.samples, start, freedom);
    if (fit && (!best || fit->rms_px < best->rms_px)) best = std::move(fit);
  }
  return best;
}

void tell_fit(const SampledHead& head, const PolynomialHead& fit, const std::string& why, ExportResult& result) {
  const std::string& name = head.calibration().name;
  result.heads.push_back({name, fit.rms_px, fit.max_px});
  if (fit.max_px < kTellExportPx) return;
  result.notes.push_back("Head '" + name + "': " + why + "; what is written is off by " + short_number(fit.rms_px) +
                         " px rms, " + short_number(fit.max_px) + " px at most.");
}

void tell_aspect(const std::vector<SampledHead>& heads, ExportResult& result) {
  for (const SampledHead& head : heads) {
    if (std::abs(head.calibration().aspect - 1) < 0.002) continue;
    result.notes.emplace_back(
        "The format knows only square pixels, and these are not: --square-pixels gives numbers "
        "for pictures that are resampled first, which fit.");
    return;
  }
}

void tell_radiometry(const Calibration& calibration, bool holds_gain_and_vignetting, ExportResult& result) {
  bool falls = false, gains = false, curves = false;
  for (const HeadCalibration& head : calibration.heads) {
    for (const double c : head.vignetting.coefficients) falls = falls || c != 0;
    for (const double g : head.gain) gains = gains || g != 1;
    curves = curves || head.response.curve != Response::Curve::kLinear;
  }
  if (curves) result.notes.emplace_back("Response curves are not written: the format has none, or another kind.");
  if ((falls || gains) && !holds_gain_and_vignetting) {
    result.notes.emplace_back("Gains and vignetting are not written: the format has none.");
  }
}

Result<ExportFormat> export_format_named(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, ExportFormat>, 6> kNames{
      {{"pto", ExportFormat::kHugin},
       {"pts", ExportFormat::kPtgui},
       {"ptv", ExportFormat::kVideoStitch},
       {"surround360", ExportFormat::kSurround360},
       {"opencv", ExportFormat::kOpenCv},
       {"kalibr", ExportFormat::kKalibr}}};
  for (const auto& [known, format] : kNames) {
    if (name == known) return format;
  }
  return fail(Errc::kBadValue, "there is no format '" + std::string(name) +
                                   "'; there are pto (Hugin), pts (PTGui), ptv (VideoStitch), surround360, opencv and "
                                   "kalibr");
}

namespace {

/// Notes the loss of masks: only Hugin's project format has polygons.
void tell_masks(const Calibration& calibration, ExportResult& result) {
  for (const HeadCalibration& head : calibration.heads) {
    if (head.region.masks.empty()) continue;
    result.notes.push_back("The masks of head '" + head.name + "' are left out: the format has none.");
  }
}

}  // namespace

Result<ExportResult> export_calibration(const Calibration& calibration, ExportFormat format,
                                        const ExportOptions& options) {
  NODAL_TRY(check_calibration(calibration));
  ExportResult result;
  NODAL_TRY_ASSIGN(std::vector<SampledHead> heads, sampled_heads(calibration, options, result));
  Status written;
  switch (format) {
    case ExportFormat::kHugin: written = export_hugin(calibration, heads, result); break;
    case ExportFormat::kPtgui: written = export_ptgui(calibration, heads, result); break;
    case ExportFormat::kVideoStitch: written = export_videostitch(calibration, heads, result); break;
    case ExportFormat::kSurround360: written = export_surround360(calibration, heads, result); break;
    case ExportFormat::kOpenCv: written = export_opencv(calibration, heads, result); break;
    case ExportFormat::kKalibr: written = export_kalibr(calibration, heads, result); break;
  }
  if (!written) return fail(written.error());
  if (format != ExportFormat::kHugin) tell_masks(calibration, result);
  return result;
}

}  // namespace nodal::interchange
