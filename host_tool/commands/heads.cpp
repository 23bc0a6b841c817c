#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <sstream>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/rig_input.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

/// Frames that are in no raymap.
std::uint64_t losses_of(const wire::HeadState& head) {
  std::uint64_t sum = head.undecodable();
  for (const wire::Count& loss : head.losses()) sum += loss.frames();
  return sum;
}

std::string show_skew(std::int64_t ns) { return fmt::format("{}{}", ns < 0 ? '-' : '+', show_duration(magnitude(ns))); }

/// One line per head, and below it its problem. With `wide` also the port, the format, the trigger and the white
/// balance, which do not fit into 80 columns.
void show(Console& console, const wire::Heads& heads, bool wide) {
  using Align = Table::Align;
  std::vector<Table::Column> columns{{"#", Align::kRight}, {"name"}};
  if (wide) columns.insert(columns.end(), {{"port"}, {"format"}, {"trigger"}, {"red, blue"}});
  columns.insert(columns.end(), {{"exposure", Align::kRight},
                                 {"gain", Align::kRight},
                                 {"frames", Align::kRight},
                                 {"lost", Align::kRight},
                                 {"skew", Align::kRight},
                                 {"clock", Align::kRight}});
  Table table(columns);
  for (const wire::HeadState& head : heads.heads()) {
    std::vector<std::string> row{std::to_string(head.index()), head.name()};
    if (wide) {
      row.insert(row.end(),
                 {head.path(), head.format(), head.trigger(), show_white_balance(head.red_q12(), head.blue_q12())});
    }
    row.insert(row.end(), {show_exposure(head.exposure_ns()), show_gain(head.gain_mdb()), std::to_string(head.frames()),
                           std::to_string(losses_of(head)), show_skew(head.skew_ns()),
                           head.has_drift_ppb() ? fmt::format("{:+.1f} ppm", head.drift_ppb() / 1000.0) : ""});
    table.row(std::move(row));
  }
  const std::vector<std::string> lines = table.lines();
  console.line(lines.front());
  for (int h = 0; h < heads.heads_size(); ++h) {
    const wire::HeadState& head = heads.heads(h);
    console.line(lines[static_cast<std::size_t>(h) + 1]);
    const std::string problem = head.problem().empty() && !head.present() ? "not there" : head.problem();
    for (const std::string& part : wrapped(problem, kLineWidth - 4)) {
      console.line("    " + console.paint(Colour::kBad, part));
    }
  }
}

Result<wire::Heads> ask_heads(RigConnection& rig) {
  wire::Request request;
  request.mutable_heads();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  return reply.heads();
}

Status run_heads(Context& context, bool wide) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY_ASSIGN(const wire::Heads heads, ask_heads(*rig));
  context.console().document(to_json(heads));
  show(context.console(), heads, wide);
  return {};
}

constexpr int kDeepestJson = 16;  ///< nesting of a rig's document; deeper parts would exhaust the stack

/// A copy of a rig's document whose texts are printable.
Json cleaned(const Json& from) {
  if (from.is_string()) return printable(from.get_ref<const std::string&>(), kMaxSentenceBytes);
  if (!from.is_structured()) return from;
  Json clean = from.is_array() ? Json::array() : Json::object();
  for (const auto& [key, value] : from.items()) {
    if (from.is_array()) clean.push_back(cleaned(value));
    else clean[printable(key, kMaxNameBytes)] = cleaned(value);
  }
  return clean;
}

/// The rig.toml in the document keeps its ends of lines: JSON escapes them.
Result<Json> parse_devices(const std::string& text) {
  const Json document = Json::parse(
      text, [](int depth, Json::parse_event_t, const Json&) { return depth <= kDeepestJson; }, false);
  if (!document.is_object()) return fail(Errc::kBadFormat, "the rig sent a list of devices that is no JSON object");
  Json clean = cleaned(document);
  if (const auto toml = document.find("rig_toml"); toml != document.end() && toml->is_string()) {
    std::istringstream lines(toml->get<std::string>());
    std::string whole;
    for (std::string line; std::getline(lines, line);) whole += printable(line, kMaxSentenceBytes) + "\n";
    clean["rig_toml"] = whole;
  }
  return clean;
}

Status run_scan(Context& context) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  wire::Request request;
  request.mutable_devices();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig->ask_long(request, [](const wire::RigStatus&) {}));
  if (context.json) {
    NODAL_TRY_ASSIGN(const Json document, parse_devices(reply.devices().json()));
    context.console().document(document);
  }
  for (const std::string& line : reply.devices().lines()) context.console().line(line);
  return {};
}

struct SetArgs {
  std::vector<std::string> heads;
  std::string exposure;
  std::string gain;
  std::string white_balance;
  std::string gamma;
};

Result<wire::HeadSetRequest> parse_settings(const SetArgs& args) {
  wire::HeadSetRequest settings;
  if (!args.exposure.empty()) {
    NODAL_TRY_ASSIGN(const Exposure exposure, parse_exposure(args.exposure));
    settings.set_exposure_ns(static_cast<std::uint64_t>(exposure.duration().ns()));
  }
  if (!args.gain.empty()) {
    NODAL_TRY_ASSIGN(const Gain gain, parse_gain(args.gain));
    settings.set_gain_mdb(gain.mdb());
  }
  if (!args.white_balance.empty()) {
    NODAL_TRY_ASSIGN(const WhiteBalance balance, parse_white_balance(args.white_balance));
    settings.set_red_q12(balance.red_q12);
    settings.set_blue_q12(balance.blue_q12);
  }
  if (!args.gamma.empty()) {
    NODAL_TRY_ASSIGN(const std::uint32_t gamma, parse_gamma(args.gamma));
    settings.set_gamma(gamma);
  }
  return settings;
}

Status run_set(Context& context, const SetArgs& args) {
  NODAL_TRY_ASSIGN(const wire::HeadSetRequest settings, parse_settings(args));
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY_ASSIGN(const wire::Heads heads, ask_heads(*rig));

  wire::Request request;
  *request.mutable_head_set() = settings;
  std::string names;
  const bool all = std::ranges::find(args.heads, "all") != args.heads.end();
  for (const std::string& name : args.heads) {
    if (all) break;
    NODAL_TRY_ASSIGN(const std::uint32_t index, find_head(heads, name));
    request.mutable_head_set()->add_heads(index);
    names += (names.empty() ? "" : ", ") + name;
  }
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig->ask(request));
  const std::string whom = all ? fmt::format("all {} heads", heads.heads_size()) : names;
  context.console().line(whom + ": set; in effect after a few frames, and `nodal heads` shows when");
  show_setting(context.console(), {{"heads", all ? Json("all") : Json(args.heads)}, {"done", true}}, reply);
  return {};
}

}  // namespace

Result<std::uint32_t> find_head(const wire::Heads& heads, const std::string& name) {
  for (const wire::HeadState& head : heads.heads()) {
    if (head.name() == name) return head.index();
  }
  std::uint32_t index = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), index);
  if (error == std::errc() && end == name.data() + name.size()) {
    for (const wire::HeadState& head : heads.heads()) {
      if (head.index() == index) return index;
    }
  }
  std::string known;
  for (const wire::HeadState& head : heads.heads()) known += (known.empty() ? "" : ", ") + head.name();
  return fail(Errc::kNoSuchDevice, fmt::format("no head is called '{}'; there are {}, or say `all`", name, known));
}

void add_heads(CLI::App& app, CommandLine& line) {
  CLI::App* heads = add_command(app, "heads", "List the heads: device, settings in effect, losses and skew",
                                "  nodal heads\n"
                                "  nodal heads --json | jq '.heads[] | select(.present|not).name'\n");
  auto wide = std::make_shared<bool>(false);
  heads->require_subcommand(0, 1);
  CLI::Option* const wide_flag = heads->add_flag(
      "--wide", *wide,
      "Also port, format, trigger (free: the head's own clock) and white balance;\nwider than 80 columns");
  line.on(heads, [wide](Context& context) { return run_heads(context, *wide); });

  CLI::App* scan = add_command(*heads, "scan", "List what is plugged into the rig's board, as a rig.toml with comments",
                               "  nodal heads scan > rig.toml\n"
                               "  nodal heads scan --json | jq '.devices[].port'\n");
  scan->excludes(wide_flag);
  line.on(scan, run_scan);
  add_latency(*heads, line);

  CLI::App* head = add_command(app, "head", "Change a head's settings", "");
  head->require_subcommand(1);
  CLI::App* set = add_command(*head, "set", "Set exposure, gain, white balance or gamma of one head, of some or of all",
                              "  nodal head set all --exposure 1/125 --gain 6dB\n"
                              "  nodal head set cam3 cam4 --exposure 8ms\n"
                              "  nodal head set 0 --wb 1.5,1.25          red and blue against green\n");
  auto args = std::make_shared<SetArgs>();
  set->add_option("HEAD", args->heads, "Names or indices of heads, or `all`")->required()->type_name("");
  set->add_option("--exposure", args->exposure, "8ms, 500us, or a fraction of a second: 1/125")
      ->type_name("TIME")
      ->check(checked_by(parse_exposure));
  set->add_option("--gain", args->gain, "Gain in decibels: 6dB; 6.02dB is one stop")
      ->type_name("GAIN")
      ->check(checked_by(parse_gain));
  set->add_option("--wb", args->white_balance, "White balance: gains of red and blue relative to green: 1.5,1.25")
      ->type_name("RED,BLUE")
      ->check(checked_by(parse_white_balance));
  set->add_option("--gamma", args->gamma, "Numbers = light^(1/gamma): 2.2; `own` for the curve it was calibrated with")
      ->type_name("GAMMA")
      ->check(checked_by(parse_gamma));
  set->parse_complete_callback([args] {
    if (args->exposure.empty() && args->gain.empty() && args->white_balance.empty() && args->gamma.empty()) {
      throw CLI::RequiredError("at least one of --exposure, --gain, --wb and --gamma");
    }
  });
  line.on(set, [args](Context& context) { return run_set(context, *args); });
}

}  // namespace nodal::host
