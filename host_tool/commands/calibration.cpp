#include <fmt/format.h>

#include <charconv>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/trial.h"
#include "host_tool/console/files.h"
#include "host_tool/console/quantities.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/report/calibration_report.h"
#include "host_tool/rig/not_recorded.h"
#include "host_tool/rig/upload.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/try.h"
#include "protocol/calibration.h"
#include "protocol/ssh_signature.h"

namespace nodal::host {
namespace {

constexpr int kUploadAttempts = 4;

constexpr const char* kAllowOlderHelp =
    "Also if the rig has had a newer signed generation, or its signature names none";

struct CalibrationArgs {
  std::string file;
  std::string id;
  std::string out;
  bool unchecked = false;
  bool trial = false;
  std::string signature;
  bool allow_older = false;
};

/// Parses the first digits of an id to bytes; an odd number of digits is an error.
Result<std::string> parse_id(const std::string& text) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    std::uint8_t byte = 0;
    const auto [end, error] = std::from_chars(text.data() + i, text.data() + i + 2, byte, 16);
    if (error != std::errc() || end != text.data() + i + 2) break;
    bytes.push_back(static_cast<char>(byte));
  }
  if (text.empty() || text.size() > 64 || bytes.size() * 2 != text.size()) {
    return fail(Errc::kBadValue, fmt::format("calibration id '{}': an even number of its first hexadecimal digits, as "
                                             "`nodal calibration list` shows them",
                                             text));
  }
  return bytes;
}

/// Sets `document` to what is uploaded: the file, or what `nodal import` makes of a project.
Result<Calibration> read_to_upload(const std::string& file, Console& console, std::string& document) {
  NODAL_TRY_ASSIGN(document, read_file(file, kMaxCalibrationFileBytes));
  NODAL_TRY_ASSIGN(CalibrationFile read, parse_calibration_file(document, file));
  for (const std::string& note : read.content.notes) console.note("note: " + note);
  if (!read.own) document = to_json(read.content.calibration);
  return std::move(read.content.calibration);
}

/// Reads the file that --signature names; without the option FILE.sig if it exists; else returns nothing.
Result<std::string> read_signature(const CalibrationArgs& args) {
  const std::string file = args.signature.empty() ? args.file + ".sig" : args.signature;
  Result<std::string> text = read_file(file, kMaxSignatureBytes);
  if (!text && args.signature.empty() && text.error().code == Errc::kNotFound) return std::string();
  return text;
}

Status run_trial(Context& context, const CalibrationArgs& args) {
  std::string content;
  NODAL_TRY_ASSIGN(const Calibration calibration, read_to_upload(args.file, context.console(), content));
  NODAL_TRY_ASSIGN(const std::string signature, read_signature(args));
  NODAL_TRY_ASSIGN(const TrialVerdict verdict,
                   try_out(context, calibration, kLiveSets, {RigTrial::kUsualLimit, signature, args.allow_older},
                           std::move(content)));
  tell_verdict(context, verdict);
  return {};
}

Status run_upload(Context& context, const CalibrationArgs& args) {
  if (args.trial) return run_trial(context, args);
  std::string content;
  const Result<Calibration> calibration = read_to_upload(args.file, context.console(), content);
  if (!calibration) {
    const bool possible = !content.empty() && content.size() <= kMaxCalibrationBytes;
    if (!possible || !args.unchecked) return fail(calibration.error());
    context.console().warning(calibration.error().text() + "; sent nevertheless because of --unchecked");
  }
  NODAL_TRY_ASSIGN(const std::string signature, read_signature(args));
  const Reconnect connect = [&context] { return context.connect(); };
  NODAL_TRY_ASSIGN(const Uploaded done, upload(connect, {content.begin(), content.end()}, kUploadAttempts,
                                               context.console(), {std::nullopt, signature, args.allow_older}));
  const std::string id = calibration ? to_hex(calibration_id(*calibration)) : "";
  context.console().document(
      {{"id", id}, {"bytes", done.bytes}, {"resumed_at", done.resumed_at}, {"links", done.links}, {"in_force", true}});
  context.console().line(fmt::format("{} ({}) is in force, id {}", calibration ? calibration->name : args.file,
                                     show_bytes(done.bytes), id.substr(0, 12)));
  return {};
}

Status list_calibrations(Context& context) {
  wire::Request request;
  request.mutable_calibration_list();
  NODAL_TRY_ASSIGN(const wire::Reply reply, context.ask(request));
  Json list = Json::array();
  Table table({{""}, {"id"}, {"generation", Table::Align::kRight}, {"heads", Table::Align::kRight}, {"name"}});
  for (const wire::CalibrationEntry& entry : reply.calibrations().entries()) {
    list.push_back(to_json(entry));
    table.row({entry.on_trial()   ? "* trial"
               : entry.in_force() ? "*"
                                  : "",
               show_id(entry.id()), std::to_string(entry.generation()), std::to_string(entry.heads()), entry.name()});
  }
  Json document{{"calibrations", list}};
  if (const auto& all = reply.calibrations(); all.has_signed_generation()) {
    document["signed_generation"] = all.signed_generation();
  }
  context.console().document(document);
  if (list.empty()) {
    context.console().line("the rig has no calibration; `nodal calibration upload FILE` uploads one");
    return {};
  }
  for (const std::string& line : table.lines()) context.console().line(line);
  if (const auto& all = reply.calibrations(); all.has_signed_generation()) {
    context.console().line(fmt::format("the rig requires signatures; the next generation is {}",
                                       std::uint64_t{all.signed_generation()} + 1));
  }
  return {};
}

Status show_calibration(Context& context, const CalibrationArgs& args) {
  wire::Request request;
  request.mutable_calibration_get();
  if (!args.id.empty()) {
    NODAL_TRY_ASSIGN(const std::string id, parse_id(args.id));
    request.mutable_calibration_get()->set_id(id);
  }
  NODAL_TRY_ASSIGN(const wire::Reply reply, context.ask(request));
  const std::string& json = reply.calibration().json();
  const Result<Calibration> calibration = parse_calibration(json);
  if (!calibration) return fail(calibration.error().in("the rig's calibration"));
  if (!args.out.empty()) {
    NODAL_TRY(write_file(args.out, to_json(*calibration)));
    context.console().note("wrote " + args.out);
  }
  if (context.console().json()) {
    context.console().document(Json::parse(canonical_json(*calibration), nullptr, false));
    return {};
  }
  NODAL_TRY_ASSIGN(const CalibrationReport report, report_on(*calibration));
  show(context.console(), report);
  return {};
}

/// Prints which calibration is in force after `use` and `rollback`.
Status tell_in_force(Context& context, const wire::Request& request) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  const auto show_activity = [&](const wire::RigStatus& status) { context.console().activity(status.activity()); };
  NODAL_TRY_ASSIGN(const wire::Reply done, rig->ask_long(request, show_activity));
  context.console().finish_progress();
  note_not_recorded(context.console(), done);
  wire::Request list;
  list.mutable_calibration_list();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig->ask(list));
  for (const wire::CalibrationEntry& entry : reply.calibrations().entries()) {
    if (!entry.in_force()) continue;
    context.console().document(to_json(entry));
    context.console().line(
        fmt::format("{} is in force, id {}, generation {}", entry.name(), show_id(entry.id()), entry.generation()));
  }
  return {};
}

Status run_use(Context& context, const CalibrationArgs& args) {
  NODAL_TRY_ASSIGN(const std::string id, parse_id(args.id));
  wire::Request request;
  request.mutable_calibration_use()->set_id(id);
  request.mutable_calibration_use()->set_allow_older(args.allow_older);
  return tell_in_force(context, request);
}

Status run_rollback(Context& context) {
  wire::Request request;
  request.mutable_calibration_rollback();
  return tell_in_force(context, request);
}

Status run_check(Context& context, const CalibrationArgs& args) {
  NODAL_TRY_ASSIGN(const Calibration calibration, read_calibration(args.file, context.console()));
  const Result<CalibrationReport> report = report_on(calibration);
  if (!report) return fail(report.error().in(args.file));
  context.console().document(to_json(*report));
  show(context.console(), *report);
  return {};
}

}  // namespace

void add_calibration(CLI::App& app, CommandLine& line) {
  CLI::App* group = add_command(app, "calibration", "The calibration of the rig: check, upload, list, choose", "");
  group->require_subcommand(1);
  auto args = std::make_shared<CalibrationArgs>();
  const auto add = [&](const std::string& name, const std::string& description, const std::string& examples) {
    return add_command(*group, name, description, examples);
  };

  CLI::App* upload = add("upload", "Check a calibration, send it, and put it in force between two frame sets",
                         "  nodal calibration upload rig.json\n"
                         "An interrupted upload continues where it stopped, also in a second run of `nodal`.\n");
  upload->add_option("FILE", args->file, "The calibration, or another program's project")->required()->type_name("");
  CLI::Option* unchecked =
      upload->add_flag("--unchecked", args->unchecked, "Send it even if it is wrong; the rig checks it again");
  upload->add_flag("--trial", args->trial, "Keep it only if the heads differ by less with it; else the rig goes back")
      ->excludes(unchecked);
  upload->add_option("--signature", args->signature, "Its signature by ssh-keygen -Y sign; FILE.sig when not given")
      ->type_name("FILE");
  upload->add_flag("--allow-older", args->allow_older, kAllowOlderHelp);
  line.on(upload, [args](Context& context) { return run_upload(context, *args); });

  line.on(add("list", "The calibrations that the rig keeps; * is the one in force", "  nodal calibration list\n"),
          list_calibrations);

  CLI::App* show = add("show", "A calibration of the rig: fields of view, places, coverage",
                       "  nodal calibration show                  the one in force\n"
                       "  nodal calibration show 3fa2 --out copy.json\n");
  show->add_option("ID", args->id, "The first digits of the calibration's id; the one in force when not given")
      ->type_name("");
  show->add_option("-o,--out", args->out, "Also write the calibration to this file")->type_name("FILE");
  line.on(show, [args](Context& context) { return show_calibration(context, *args); });

  CLI::App* use = add("use", "Put another calibration of the rig in force", "  nodal calibration use 3fa2b1\n");
  use->add_option("ID", args->id, "The first digits of the calibration's id")->required()->type_name("");
  use->add_flag("--allow-older", args->allow_older, kAllowOlderHelp);
  line.on(use, [args](Context& context) { return run_use(context, *args); });

  line.on(add("rollback", "Go back to the calibration that was in force before", "  nodal calibration rollback\n"),
          run_rollback);

  CLI::App* check = add("check", "Check a calibration file and describe it; needs no rig",
                        "  nodal calibration check rig.json\n"
                        "  nodal calibration check rig.json --json | jq .unseen\n");
  check->add_option("FILE", args->file, "The calibration, or another program's project")->required()->type_name("");
  line.on(check, [args](Context& context) { return run_check(context, *args); });

  add_calibration_diff(*group, line);
  add_calibration_join(*group, line);
}

}  // namespace nodal::host
