#include "stitch/interchange/import.h"
#include "protocol/base/try.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/picture_places_option.h"
#include "host_tool/commands/replay_toml.h"
#include "host_tool/console/files.h"
#include "host_tool/input/project_pictures.h"
#include "host_tool/report/calibration_report.h"
#include "stitch/geometry/head.h"
#include "stitch/media/image_file.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxPointErrorDeg = 1;  // rms; a project with a larger error shows double edges at every seam

struct ImportArgs {
  std::vector<std::string> files;
  std::string out = "calibration.json";
  std::string name;
  std::string rig_toml;
  PicturePlaces places = PicturePlaces::kBesideProject;
};

/// How well the project's control points agree under the imported calibration, per pair of heads.
struct Residual {
  std::size_t points = 0;
  double sum_of_squares = 0;  ///< degrees squared
  double worst = 0;           ///< degrees
  double rms() const { return points == 0 ? 0 : std::sqrt(sum_of_squares / static_cast<double>(points)); }
  void add(double degrees) {
    ++points;
    sum_of_squares += degrees * degrees;
    worst = std::max(worst, degrees);
  }
};
using Residuals = std::map<std::pair<std::size_t, std::size_t>, Residual>;

Result<Residuals> residuals_of(const interchange::ImportResult& imported) {
  NODAL_TRY_ASSIGN(const std::vector<geometry::Head> heads, geometry::make_heads(imported.calibration));
  Residuals residuals;
  for (const interchange::ControlPoint& point : imported.control_points) {
    const auto a = heads[point.head_a].unproject(point.pixel_a);
    const auto b = heads[point.head_b].unproject(point.pixel_b);
    if (!a || !b) continue;  // outside the lens; the importer's notes report it
    residuals[std::minmax(point.head_a, point.head_b)].add(geometry::angle_between(*a, *b) * 180 / std::numbers::pi);
  }
  return residuals;
}

Residual total_of(const Residuals& residuals) {
  Residual total;
  for (const auto& [pair, residual] : residuals) {
    total.points += residual.points;
    total.sum_of_squares += residual.sum_of_squares;
    total.worst = std::max(total.worst, residual.worst);
  }
  return total;
}

/// A rig.toml with replay heads for the project's pictures; notes those that are not where the project says.
Result<std::string> rig_toml_of(interchange::ImportResult& imported, const ImportArgs& args) {
  for (std::size_t i = 0; i < imported.images.size(); ++i) {
    if (imported.images[i].empty()) {
      return fail(Errc::kMissingField, fmt::format("{}: names no picture for head '{}', so there is nothing to replay; "
                                                   "leave out --rig-toml",
                                                   args.files.front(), imported.calibration.heads[i].name));
    }
  }
  NODAL_TRY_ASSIGN(const FoundPictures pictures, project_pictures(args.files.front(), imported.images, args.places));
  imported.notes.insert(imported.notes.end(), pictures.notes.begin(), pictures.notes.end());
  return replay_rig_toml(imported.calibration, pictures.files, fs::path(args.files.front()).filename().string(),
                         args.rig_toml);
}

/// Sentences about pictures that the project names and that are not there, cannot be read, or have another size than
/// the project says. Without --rig-toml only about those that are there: a project may have been copied without its
/// pictures.
std::vector<std::string> picture_warnings(const interchange::ImportResult& imported, const ImportArgs& args) {
  const bool all = !args.rig_toml.empty();
  std::vector<std::string> warnings;
  for (std::size_t i = 0; i < imported.images.size(); ++i) {
    const HeadCalibration& head = imported.calibration.heads[i];
    const std::string& image = imported.images[i];
    if (image.empty()) continue;  // files of cameras name none
    const Result<ProjectPicture> picture = project_picture(args.files.front(), image, args.places);
    if (!picture) {
      warnings.push_back(picture.error().message);
      continue;
    }
    const std::string& file = picture->file;
    std::error_code error;
    const bool present = fs::is_regular_file(file, error);
    if (!present && !all) continue;
    const Result<ImageHeader> header = media::read_image_header(file);
    if (!present) {
      warnings.push_back(
          fmt::format("head '{}': there is no picture '{}'; correct its port in rig.toml", head.name, image));
    } else if (!header) {
      warnings.push_back(
          fmt::format("head '{}': {}; heads replay JPEG and PNG pictures only", head.name, header.error().message));
    } else if (header->width != head.width || header->height != head.height) {
      warnings.push_back(
          fmt::format("head '{}': picture '{}' has {}x{} pixels, but the project was made for {}x{}; the "
                      "calibration does not fit it",
                      head.name, image, header->width, header->height, head.width, head.height));
    }
  }
  return warnings;
}

void tell(Console& console, const interchange::ImportResult& imported, const CalibrationReport& report,
          const Residuals& residuals, const ImportArgs& args) {
  Json pairs = Json::array();
  for (const auto& [pair, residual] : residuals) {
    pairs.push_back(
        {{"heads", {imported.calibration.heads[pair.first].name, imported.calibration.heads[pair.second].name}},
         {"points", residual.points},
         {"rms_deg", residual.rms()},
         {"worst_deg", residual.worst}});
  }
  const std::vector<std::string> warnings = picture_warnings(imported, args);
  console.document({{"out", args.out},
                    {"notes", imported.notes},
                    {"warnings", warnings},
                    {"residuals", pairs},
                    {"calibration", to_json(report)}});
  show(console, report);
  for (const std::string& note : imported.notes) console.note("note: " + note);
  for (const std::string& warning : warnings) console.warning(warning);
  if (const Residual total = total_of(residuals); total.points != 0) {
    console.line(fmt::format("  {} control points of {} pairs of heads: error {:.3f}° rms, {:.3f}° at most",
                             total.points, residuals.size(), total.rms(), total.worst));
    if (total.rms() > kMaxPointErrorDeg) {
      console.warning(
          fmt::format("control points that are off by {:.1f}° do not fit to the project's lenses and "
                      "directions; optimize the project in the program that made it, and import it again",
                      total.rms()));
    }
  }
  console.line("wrote " + args.out + (args.rig_toml.empty() ? "" : " and " + args.rig_toml));
}

/// Errors name the file.
Result<interchange::ImportResult> imported_from(const ImportArgs& args) {
  std::vector<interchange::CameraFile> files;
  for (const std::string& path : args.files) {
    NODAL_TRY_ASSIGN(std::string text, read_file(path, interchange::kMaxProjectBytes));
    files.push_back({path, std::move(text)});
  }
  const std::string& first = args.files.front();
  const std::string name = args.name.empty() ? fs::path(first).stem().string() : args.name;
  if (files.size() > 1) return interchange::import_cameras(files, name);
  Result<interchange::ImportResult> imported = interchange::import_project(files.front().text, name);
  if (!imported) return fail(imported.error().in(first));
  return imported;
}

Status run_import(Context& context, const ImportArgs& args) {
  NODAL_TRY_ASSIGN(interchange::ImportResult imported, imported_from(args));
  const Result<CalibrationReport> report = report_on(imported.calibration);
  if (!report) return fail(report.error().in(args.files.front()));
  const Result<Residuals> residuals = residuals_of(imported);
  if (!residuals) return fail(residuals.error().in(args.files.front()));

  if (!args.rig_toml.empty()) {
    NODAL_TRY_ASSIGN(const std::string toml, rig_toml_of(imported, args));
    NODAL_TRY(write_file(args.rig_toml, toml));
  }
  NODAL_TRY(write_file(args.out, to_json(imported.calibration)));
  tell(context.console(), imported, *report, *residuals, args);
  return {};
}

}  // namespace

void add_import(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(app, "import", "Convert another program's project to a calibration; needs no rig",
                                  "  nodal import rig.pts -o calibration.json\n"
                                  "  nodal import hugin.pto --rig-toml rig.toml     and replay its pictures\n"
                                  "  nodal import camchain.yaml -o rig.json\n"
                                  "  nodal import left.yaml right.yaml -o rig.json  OpenCV's cameras, one a file\n"
                                  "Knows Hugin's projects (.pto), PTGui's text ones (.pts), VideoStitch's (.ptv),\n"
                                  "Surround360's rigs (.json), OpenCV's cameras and Kalibr's chains (.yaml), and\n"
                                  "OCamCalib's cameras (calib_results.txt). Says what did not fit, and how well a\n"
                                  "project's control points agree.\n");
  auto args = std::make_shared<ImportArgs>();
  command
      ->add_option(
          "FILE", args->files,
          "The project: .pto, .pts, .ptv, .json, .yaml or .txt; or cameras of OpenCV or\nOCamCalib, one a file")
      ->required()
      ->type_name("");
  command->add_option("-o,--out", args->out, "The calibration (calibration.json when not given)")->type_name("FILE");
  command->add_option("--name", args->name, "The calibration's name; the (first) file's when not given")
      ->type_name("NAME");
  command->add_option("--rig-toml", args->rig_toml, "Write a rig.toml, too, with heads that replay the pictures")
      ->type_name("FILE");
  add_picture_places(*command, args->places);
  line.on(command, [args](Context& context) { return run_import(context, *args); });
}

}  // namespace nodal::host
