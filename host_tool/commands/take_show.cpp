// `nodal take show`: what a take holds.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>

#include "host_tool/commands/take_argument.h"
#include "host_tool/console/quantities.h"

namespace nodal::host {
namespace {

/// What the evidence says about one head.
struct HeadSummary {
  std::string stored{};  ///< "720x480 YUYV as Ut Video, top-first"
  std::map<std::string, std::uint64_t> placeholders{};
  std::uint64_t pictures = 0;
};

std::string stored_as(const media::TakeStream& stream) {
  std::string text = fmt::format("{}x{} {}", stream.width, stream.height, pixel_format_name(stream.format));
  if (stream.lossless) text += " as Ut Video";
  if (stream.fields == Fields::kTopFirst) text += ", top-first";
  if (stream.fields == Fields::kBottomFirst) text += ", bottom-first";
  return text;
}

Status run_show(Context& context, const std::string& name) {
  const Result<media::TakeFolder> folder = open_take(context, name);
  if (!folder) return fail(folder.error());
  const take::TakeDocument& about = folder->about();
  const take::Manifest& manifest = folder->manifest();

  std::array<HeadSummary, kMaxHeads> heads;
  std::map<std::uint64_t, std::int64_t> starts;  // of marked sets, ns after the take's first that is there
  for (const take::Manifest::Mark& mark : manifest.marks) starts[mark.set] = -1;
  media::TakeSets sets(*folder);
  media::TakeSet set;
  std::int64_t first = 0;
  for (bool begun = false;; begun = true) {
    const Result<bool> more = sets.next(set);
    if (!more) return fail(more.error());
    if (!*more) break;
    if (!begun) first = set.mid_exposure.ns();
    const auto marked = starts.find(set.evidence.index());
    if (marked != starts.end()) marked->second = set.mid_exposure.ns() - first;
    for (const take::wire::Frame& frame : set.evidence.frames()) {
      const media::TakeStream& stream = sets.segment().streams()[frame.file()];
      HeadSummary& head = heads[*stream.head];
      head.stored = stored_as(stream);
      if (frame.placeholder().empty()) ++head.pictures;
      else ++head.placeholders[frame.placeholder()];
    }
  }

  Console& console = context.console();
  Json json{{"take", manifest.number},
            {"rig", about.rig},
            {"software", about.software},
            {"sets", manifest.sets},
            {"lost_sets", manifest.lost_sets},
            {"deleted_sets", manifest.deleted_sets},
            {"bytes", manifest.bytes()},
            {"length_ns", manifest.length.ns()},
            {"ended", manifest.ended},
            {"mode", about.mode},
            {"started_utc_ns", about.started_utc_ns},
            {"calibration", about.calibration_id}};
  Json json_heads = Json::array(), json_marks = Json::array(), json_calibrations = Json::array();
  Table table({{"head"}, {"stored as"}, {"pictures", Table::Align::kRight}, {"missing", Table::Align::kRight}});
  for (std::size_t i = 0; i < about.heads.size(); ++i) {
    std::uint64_t missing = 0;
    for (const auto& [why, count] : heads[i].placeholders) missing += count;
    json_heads.push_back({{"name", about.heads[i]},
                          {"stored_as", heads[i].stored},
                          {"pictures", heads[i].pictures},
                          {"placeholders", heads[i].placeholders}});
    table.row({about.heads[i], heads[i].stored.empty() ? "nothing" : heads[i].stored, std::to_string(heads[i].pictures),
               std::to_string(missing)});
  }
  const std::string length = show_duration(static_cast<std::uint64_t>(std::max<std::int64_t>(0, manifest.length.ns())));
  console.line(fmt::format("take {} of rig {}, {}, {}, {}", manifest.number, about.rig, counted(manifest.sets, "set"),
                           length, show_bytes(manifest.bytes())));
  console.line(fmt::format("recorded by {}, mode {}; ended: {}", about.software, about.mode, manifest.ended));
  if (manifest.lost_sets != 0) {
    console.line(
        console.paint(Colour::kBad, fmt::format("{} lost: the disk was too slow", counted(manifest.lost_sets, "set"))));
  }
  if (manifest.deleted_sets != 0) {
    console.line(
        fmt::format("{} deleted by the rig, to make room for newer ones", counted(manifest.deleted_sets, "set")));
  }
  console.line(about.calibration_id.empty() ? "without a calibration"
                                            : "calibration " + about.calibration_id.substr(0, 12));
  for (const take::Manifest::Calibration& each : manifest.calibrations) {
    console.line(fmt::format("calibration {} from the rig's set {} on", each.id.substr(0, 12), each.set));
    json_calibrations.push_back({{"file", each.file}, {"id", each.id}, {"set", each.set}});
  }
  for (const std::string& line : table.lines()) console.line(line);
  for (const take::Manifest::Mark& mark : manifest.marks) {
    const std::int64_t known = starts[mark.set];  // -1: of no set, behind the last
    const std::int64_t at = known < 0 ? std::max<std::int64_t>(0, manifest.length.ns()) : known;
    json_marks.push_back({{"set", mark.set}, {"at_ns", at}, {"text", mark.text}});
    console.line(fmt::format("mark at {}: {}", show_duration(static_cast<std::uint64_t>(at)), mark.text));
  }
  json["heads"] = json_heads;
  json["marks"] = json_marks;
  json["later_calibrations"] = json_calibrations;
  console.document(json);
  return {};
}

}  // namespace

void add_take_show(CLI::App& group, CommandLine& line) {
  auto folder = std::make_shared<std::string>();
  CLI::App* show = add_command(group, "show", "What a take holds: heads, marks, what is missing",
                               "  nodal take show 42        on the rig\n"
                               "  nodal take show 000042    a copy\n");
  show->add_option("TAKE", *folder, kTakeArgumentHelp)->required()->type_name("");
  line.on(show, [folder](Context& context) { return run_show(context, *folder); });
}

}  // namespace nodal::host
