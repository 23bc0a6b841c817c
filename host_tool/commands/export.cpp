#include "stitch/interchange/export.h"
#include "protocol/base/try.h"

#include <fmt/format.h>

#include <filesystem>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/input/calibration_file.h"
#include "protocol/calibration.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

struct ExportArgs {
  std::string file;
  std::string format;
  std::string out;
  std::vector<std::string> images;
  bool square_pixels = false;
};

/// The default file name of a format.
std::string extension_of(const std::string& format) {
  if (format == "opencv" || format == "kalibr") return ".yaml";
  if (format == "surround360") return ".json";
  return "." + format;
}

/// rig.yaml if there is one file; rig-HEAD.yaml if each head has its own.
std::string path_of(const std::string& out, const interchange::ExportedFile& file, std::size_t files) {
  if (files == 1 || file.head.empty()) return out;
  const fs::path path(out);
  return (path.parent_path() / (path.stem().string() + "-" + file.head + path.extension().string())).string();
}

Status run_export(Context& context, const ExportArgs& args) {
  NODAL_TRY_ASSIGN(const interchange::ExportFormat format, interchange::export_format_named(args.format));
  NODAL_TRY_ASSIGN(const Calibration rig, read_calibration(args.file, context.console()));
  if (!args.images.empty() && args.images.size() != rig.heads.size()) {
    return fail(Errc::kBadValue, fmt::format("--images names {} pictures; {} has {} heads", args.images.size(),
                                             args.file, rig.heads.size()));
  }
  const Result<interchange::ExportResult> result =
      interchange::export_calibration(rig, format, {args.images, args.square_pixels});
  if (!result) return fail(result.error().in(args.file));
  std::string out = args.out;
  if (out.empty()) out = fs::path(args.file).stem().string() + "-" + args.format + extension_of(args.format);
  Json written = Json::array();
  for (const interchange::ExportedFile& file : result->files) {
    const std::string path = path_of(out, file, result->files.size());
    NODAL_TRY(write_file(path, file.text));
    written.push_back(path);
  }
  Json heads = Json::array();
  Table table({{"head"}, {"off by px rms", Table::Align::kRight}, {"at most", Table::Align::kRight}});
  for (const interchange::ExportedHead& head : result->heads) {
    heads.push_back({{"name", head.name}, {"rms_px", head.rms_px}, {"max_px", head.max_px}});
    table.row({head.name, fmt::format("{:.4f}", head.rms_px), fmt::format("{:.4f}", head.max_px)});
  }
  context.console().document({{"out", written}, {"format", args.format}, {"heads", heads}, {"notes", result->notes}});
  for (const std::string& line : table.lines()) context.console().line(line);
  for (const std::string& note : result->notes) context.console().note("note: " + note);
  for (const Json& path : written) context.console().line("wrote " + path.get<std::string>());
  return {};
}

}  // namespace

void add_export(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      add_command(app, "export", "Write a calibration for another program; needs no rig",
                  "  nodal export rig.json --format pto -o rig.pto              Hugin\n"
                  "  nodal export rig.json --format pto --square-pixels         pictures resampled first\n"
                  "  nodal export rig.json --format opencv -o cam.yaml          one file a head\n"
                  "Formats: pto (Hugin), pts (PTGui), ptv (VideoStitch), surround360, opencv, kalibr. What a format\n"
                  "cannot represent is approximated; the error is printed for every head, in pixels.\n");
  auto args = std::make_shared<ExportArgs>();
  command->add_option("FILE", args->file, "The calibration, or another program's project")->required()->type_name("");
  command->add_option("--format", args->format, "pto, pts, ptv, surround360, opencv or kalibr")
      ->required()
      ->type_name("pto|pts|ptv|surround360|opencv|kalibr")
      ->check(checked_by([](std::string_view name) { return interchange::export_format_named(name); }));
  command->add_option("-o,--out", args->out, "The file to write; named after the calibration when not given")
      ->type_name("FILE");
  command->add_option("--images", args->images, "The heads' pictures, in order, as the file should name them")
      ->type_name("FILE");
  command->add_flag(
      "--square-pixels", args->square_pixels,
      "Write lenses for pictures that are resampled to square pixels, for programs that know no other pixels");
  line.on(command, [args](Context& context) { return run_export(context, *args); });
}

}  // namespace nodal::host
