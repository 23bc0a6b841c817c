#include "host_tool/commands/register_output.h"

#include <fmt/format.h>

#include <cmath>

#include "host_tool/console/quantities.h"
#include "host_tool/report/registration_report.h"
#include "stitch/geometry/rotation.h"

namespace nodal::host {
namespace {

using registration::Report;

// JSON has no infinity; null means "unknown".
Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

/// The distance, and how far it may be off: parallax determines 1 / distance.
std::string distance_line(const Report& report) {
  const double nearness = report.calibration.distance > 0 ? 1 / report.calibration.distance : 0;
  const double least = nearness - 2 * report.sigma_nearness, most = nearness + 2 * report.sigma_nearness;
  if (nearness == 0 || least <= 0) {
    return fmt::format("the pictures meet beyond {:.2f} m, or at infinity", 1 / most);
  }
  return fmt::format("the pictures meet at {:.2f} m ({:.2f} to {:.2f} m)", 1 / nearness, 1 / most, 1 / least);
}

/// Where each head looks, if nothing was known of it; else how far it was turned.
Table heads_of(const Report& report, const Registered& registered) {
  using Align = Table::Align;
  std::vector<Table::Column> columns{{"head"}};
  if (registered.alone) {
    columns.insert(columns.end(), {{"yaw", Align::kRight}, {"pitch", Align::kRight}, {"roll", Align::kRight}});
  } else {
    columns.insert(columns.end(), {{"turned", Align::kRight}, {"±", Align::kRight}});
  }
  columns.push_back({"overlap", Align::kRight});
  if (registered.focals) columns.insert(columns.end(), {{"focal length", Align::kRight}, {"±", Align::kRight}});
  columns.push_back({""});
  Table table(columns);
  for (std::size_t h = 0; h < report.heads.size(); ++h) {
    const registration::HeadReport& head = report.heads[h];
    std::vector<std::string> row{head.name};
    if (registered.alone) {
      const auto looks = geometry::to_yaw_pitch_roll(geometry::matrix_of(report.calibration.heads[h].R_head_rig));
      for (const double angle : {looks.yaw, looks.pitch, looks.roll})
        row.push_back(fmt::format("{:.1f}°", std::round(10 * angle) / 10 + 0.0));
    } else {
      row.push_back(fmt::format("{:.3f}°", head.turned_deg));
      row.push_back(show_deviation(head.sigma_deg, "°"));
    }
    row.push_back(fmt::format("{:.2f} sr", head.shared_sr));
    if (registered.focals) {
      row.push_back(fmt::format("{:+.3f} %", head.focal_change_percent));
      row.push_back(show_deviation(head.sigma_focal_percent, " %"));
    }
    row.push_back(head.placed ? "" : "not placed, not changed");
    table.row(row);
  }
  return table;
}

}  // namespace

Json register_json(const Report& report) {
  Json heads = Json::array(), pairs = Json::array(), steps = Json::array();
  for (const registration::HeadReport& head : report.heads) {
    heads.push_back({{"name", head.name},
                     {"placed", head.placed},
                     {"why_not", head.why_not},
                     {"turned_deg", head.turned_deg},
                     {"sigma_deg", finite(head.sigma_deg)},
                     {"focal_change_percent", head.focal_change_percent},
                     {"sigma_focal_percent", head.sigma_focal_percent},
                     {"shared_sr", head.shared_sr}});
  }
  for (const registration::PairReport& pair : report.pairs) {
    pairs.push_back(
        {{"heads",
          {report.heads[static_cast<std::size_t>(pair.a)].name, report.heads[static_cast<std::size_t>(pair.b)].name}},
         {"shared_sr", pair.shared_sr},
         {"rms_before", pair.rms_before},
         {"rms_after", pair.rms_after},
         {"agreement", pair.agreement}});
  }
  for (const registration::Step& step : report.steps) {
    steps.push_back({{"width", step.width},
                     {"level", step.level},
                     {"iteration", step.iteration},
                     {"objective", step.objective},
                     {"turned_deg", step.turned_deg}});
  }
  return {{"distance", report.calibration.distance > 0 ? Json(report.calibration.distance) : Json(nullptr)},
          {"sigma_nearness", report.sigma_nearness},
          {"objective_before", report.objective_before},
          {"objective_after", report.objective_after},
          {"heads", heads},
          {"pairs", pairs},
          {"steps", steps},
          {"warnings", report.warnings}};
}

void print_registration(Console& console, const Report& report, const Verdict& verdict, const Registered& registered) {
  for (const std::string& line : heads_of(report, registered).lines()) console.line(line);
  if (report.sigma_nearness > 0) console.line(distance_line(report));
  if (!report.pairs.empty()) {
    console.line(
        fmt::format("where they overlap, the heads differ by {:.2f} levels of 255; before, by {:.2f} ({:.1f} s)",
                    std::sqrt(report.objective_after), std::sqrt(report.objective_before), registered.seconds));
  }
  for (const std::string& warning : report.warnings) console.warning(warning);
  console.line(verdict.sentence);
  if (const std::string poor = poor_pairs(report); !poor.empty()) {
    console.warning(poor + "; --report FILE.html shows their seams");
  }
  console.line("wrote " + registered.out);
}

}  // namespace nodal::host
