#include "host_tool/report/lens_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tool/report/html_report.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/response.h"
#include "stitch/media/png_writer.h"

namespace nodal::host {
namespace {

constexpr float kStretch = 8;  // residuals are small: one grey level of 255 is shown as eight

std::string measured(const calibration::Measured& m) { return fmt::format("{:.4f} ± {:.4f}", m.value, m.deviation); }

void add_curves(const calibration::LensCalibration& result, const geometry::Head& head, HtmlReport& report) {
  ChartSeries radius{"radius", {}}, precision{"density", {}}, fall_off{"fall-off", {}}, response{"response", {}};
  const geometry::Lens& lens = head.lens();
  const auto& v = result.head.vignetting;
  const double corner = std::hypot(head.width(), head.height()) / 2;
  for (int i = 0; i <= 100; ++i) {
    const double r = std::min(corner, lens.max_radius()) * i / 100;
    const double a = lens.angle(r).value_or(0);
    radius.points.emplace_back(r, a * 180 / std::numbers::pi);
    precision.points.emplace_back(r, lens.slope(a) * std::numbers::pi / 180);
    const double s = std::pow(r / v.radius, 2);
    fall_off.points.emplace_back(r, 1 + s * (v.coefficients[0] + s * (v.coefficients[1] + s * v.coefficients[2])));
    response.points.emplace_back(i / 100.0, geometry::encode(result.head.response, i / 100.0));
  }
  report.heading("Lens and light");
  report.chart("Angle from the axis", "radius, px", "degrees", {radius});
  report.chart("Precision along the radius", "radius, px", "px per degree", {precision});
  report.chart("Light that is left", "radius, px", "of the centre's", {fall_off});
  report.chart("Response", "light", "encoded", {response});
}

Status add_residuals(const calibration::LensCalibration& result, HtmlReport& report) {
  std::vector<std::pair<std::vector<std::uint8_t>, std::string>> pictures;
  for (std::size_t v = 0; v < result.report.residuals.size(); ++v) {
    const calibration::GreyImage& map = result.report.residuals[v];
    std::vector<std::uint8_t> grey;
    for (const float left : map.values) {
      grey.push_back(static_cast<std::uint8_t>(std::clamp(127.5F + kStretch * 255 * left, 0.0F, 255.0F)));
    }
    const calibration::ViewReport& view = result.report.views[v];
    NODAL_TRY_ASSIGN(std::vector<std::uint8_t> png, media::png_file({map.width, map.height, 1, 8, grey},
                                                                    {SampleMeaning::srgb(), 0, view.name, {}, 6}));
    pictures.emplace_back(std::move(png), fmt::format("{}: {:.1f} of 255 rms left over", view.name, view.rms));
  }
  report.heading("What the pattern and the lens do not explain");
  report.paragraph(
      fmt::format("Photograph less model, {:.0f} times stretched about grey. Even grain is noise; lines "
                  "that follow the pattern are a lens model that does not fit, or a print that is not flat.",
                  static_cast<double>(kStretch)));
  report.pictures(pictures);
  return {};
}

}  // namespace

Result<std::string> lens_report(const calibration::LensCalibration& result, const std::string& model) {
  NODAL_TRY_ASSIGN(const geometry::Head head, geometry::Head::make(result.head));
  const calibration::LensReport& found = result.report;
  HtmlReport report(
      "Lens of head " + result.head.name,
      fmt::format("{} photographs, {}x{} px, model {}: a ray's place on the picture is known to "
                  "± {:.4f} px",
                  found.views.size(), result.head.width, result.head.height, model, found.mapping_deviation_px));
  for (const std::string& note : found.notes) report.warning(note);
  report.heading("Found");
  report.table({"", "value ± standard deviation"},
               {{"focal length, px", measured(found.focal)},
                {"centre x, px", measured(found.center_x)},
                {"centre y, px", measured(found.center_y)},
                {"aspect", fmt::format("{:.6f} ± {:.6f}", found.aspect.value, found.aspect.deviation)}});
  std::vector<std::vector<std::string>> rows;
  for (const calibration::ViewReport& view : found.views) {
    rows.push_back({view.name, std::to_string(view.pairs), fmt::format("{:.1f}", view.tilt_deg),
                    fmt::format("{:.3f}", view.distance), fmt::format("{:.2f}", view.blur_px),
                    fmt::format("{:.0f}", 100 * view.covered), fmt::format("{:.2f}", 100 * view.explained),
                    fmt::format("{:.1f}", view.rms), fmt::format("{:.3f}", view.gain)});
  }
  report.heading("Photographs");
  report.table(
      {"file", "points", "tilt °", "distance, widths", "blur px", "covers %", "explained %", "left over /255", "light"},
      rows);
  add_curves(result, head, report);
  NODAL_TRY(add_residuals(result, report));
  return report.finish();
}

}  // namespace nodal::host
