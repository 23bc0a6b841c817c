#include "host_tool/report/calibration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/mask_holes.h"
#include "stitch/geometry/rotation.h"

namespace nodal::host {
namespace {

using geometry::Head;
using geometry::Pixel;
using geometry::Ray;

constexpr int kRays = 20'000;  // one per 2 square degrees

std::string lens_name(const LensModel& lens) {
  struct Name {
    const char* operator()(const TsaiLens&) const { return "tsai"; }
    const char* operator()(const RectilinearLens&) const { return "rectilinear"; }
    const char* operator()(const EquidistantLens&) const { return "equidistant"; }
    const char* operator()(const KannalaBrandtLens&) const { return "kannala_brandt"; }
  };
  return std::visit(Name{}, lens);
}

/// The angle in degrees between the axis and the last usable pixel from the lens's centre in a direction.
double reach(const Head& head, double step_x, double step_y) {
  Pixel pixel{head.calibration().center_x, head.calibration().center_y};
  double angle = 0;
  for (; head.distance_to_edge_without_masks(pixel) >= 0; pixel = {pixel.x + step_x, pixel.y + step_y}) {
    if (const std::optional<Ray> ray = head.unproject(pixel)) angle = geometry::angle_between(*ray, head.axis());
  }
  return angle * kDegreesPerRadian;
}

/// Without "-0.00" and "-180.00".
std::string show_degrees(double degrees) {
  const double rounded = std::round(degrees * 100) / 100;
  return fmt::format("{:.2f}°", rounded == 0 ? 0.0 : rounded == -180 ? 180.0 : rounded);
}

/// Ray i of kRays that are evenly spread over the sphere, on a spiral of equal areas.
Ray even_ray(int i) {
  const double y = 1 - (2 * i + 1.0) / kRays;
  const double turn = i * std::numbers::pi * (1 + std::sqrt(5.0));
  const double r = std::sqrt(1 - y * y);
  return Ray::towards(r * std::sin(turn), y, r * std::cos(turn));
}

}  // namespace

Result<CalibrationReport> report_on(const Calibration& calibration) {
  NODAL_TRY_ASSIGN(const std::vector<Head> heads, geometry::make_heads(calibration));
  CalibrationReport report;
  report.id = to_hex(calibration_id(calibration));
  report.name = calibration.name;
  for (const Head& head : heads) {
    const geometry::YawPitchRoll place = geometry::to_yaw_pitch_roll(head.R_head_rig());
    report.heads.push_back({head.name(), head.width(), head.height(), lens_name(head.calibration().lens),
                            reach(head, -0.5, 0) + reach(head, 0.5, 0), reach(head, 0, -0.5) + reach(head, 0, 0.5),
                            place.yaw, place.pitch, place.roll});
  }
  int unseen = 0;
  int twice = 0;
  std::int64_t seen_by = 0;
  for (int i = 0; i < kRays; ++i) {
    const Ray ray = even_ray(i);
    const auto count = std::ranges::count_if(heads, [&](const Head& head) { return head.pixel_of(ray).has_value(); });
    seen_by += count;
    twice += count >= 2;
    unseen += count == 0;
    if (count == 0 && !report.hole) {
      report.hole =
          CalibrationReport::Direction{ray.angles().theta * kDegreesPerRadian, -ray.angles().phi * kDegreesPerRadian};
    }
  }
  const std::vector<geometry::MaskHole> holes = geometry::find_mask_holes(heads);
  for (const geometry::MaskHole& hole : holes) {
    report.mask_holes.push_back({heads[hole.head].name(), hole.solid_angle_sr});
  }
  report.mask_warnings = geometry::describe(holes, heads);
  report.unseen = static_cast<double>(unseen) / kRays;
  report.seen_twice = static_cast<double>(twice) / kRays;
  report.heads_per_ray = static_cast<double>(seen_by) / kRays;
  return report;
}

Json to_json(const CalibrationReport& report) {
  Json heads = Json::array();
  for (const CalibratedHead& head : report.heads) {
    heads.push_back({{"name", head.name},
                     {"width", head.width},
                     {"height", head.height},
                     {"lens", head.lens},
                     {"horizontal_field_deg", head.horizontal_field},
                     {"vertical_field_deg", head.vertical_field},
                     {"yaw_deg", head.yaw},
                     {"pitch_deg", head.pitch},
                     {"roll_deg", head.roll}});
  }
  Json json{{"id", report.id},
            {"name", report.name},
            {"heads", heads},
            {"unseen", report.unseen},
            {"seen_twice", report.seen_twice},
            {"heads_per_ray", report.heads_per_ray}};
  json["mask_holes"] = Json::array();
  for (const CalibrationReport::MaskHole& hole : report.mask_holes) {
    json["mask_holes"].push_back({{"head", hole.head}, {"solid_angle_sr", hole.solid_angle_sr}});
  }
  json["hole"] = report.hole ? Json{{"yaw_deg", report.hole->yaw}, {"pitch_deg", report.hole->pitch}} : Json();
  return json;
}

void show(Console& console, const CalibrationReport& report) {
  console.line(
      fmt::format("{}: {} heads, id {}", console.paint(Colour::kStrong, report.name), report.heads.size(), report.id));
  Table table({{"head"},
               {"picture"},
               {"lens"},
               {"field", Table::Align::kRight},
               {"yaw", Table::Align::kRight},
               {"pitch", Table::Align::kRight},
               {"roll", Table::Align::kRight}});
  for (const CalibratedHead& head : report.heads) {
    table.row({head.name, fmt::format("{}×{}", head.width, head.height), head.lens,
               fmt::format("{:.1f}°×{:.1f}°", head.horizontal_field, head.vertical_field), show_degrees(head.yaw),
               show_degrees(head.pitch), show_degrees(head.roll)});
  }
  for (const std::string& line : table.lines()) console.line("  " + line);
  console.line(fmt::format("  on average, {:.2f} heads see each direction; two or more see {:.1f} % of the sphere",
                           report.heads_per_ray, 100 * report.seen_twice));
  if (report.hole) {
    console.line(console.paint(
        Colour::kWarning, fmt::format("  no head sees {:.2f} % of the sphere, for example yaw {:.0f}°, pitch {:.0f}°",
                                      100 * report.unseen, report.hole->yaw, report.hole->pitch)));
  } else {
    console.line("  heads see the whole sphere");
  }
  for (const std::string& warning : report.mask_warnings) console.line(console.paint(Colour::kWarning, "  " + warning));
}

}  // namespace nodal::host
