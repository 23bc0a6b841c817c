// `nodal take show`: what a take holds.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/take_argument.h"
#include "host_tool/console/quantities.h"
#include "protocol/base/try.h"
#include "protocol/take/tally.h"

namespace nodal::host {
namespace {

/// What the evidence says about one head.
struct HeadSummary {
  std::string stored{};  ///< "720x480 YUYV as Ut Video, top-first"
  std::map<std::string, std::uint64_t> placeholders{};
  std::uint64_t pictures = 0;
};

/// What the evidence says about placed seams.
class SeamSummary {
 public:
  /// To be called with each set in turn, `at` after the first that is there, and its segment.
  void add(const take::Segment& segment, std::uint64_t number, Duration at) {
    const take::wire::Seams* const used = segment.seams_at(number);
    const std::optional<std::uint64_t> since = used ? std::optional(used->set()) : std::nullopt;
    if (sets_ > 0 && since && since != since_) {
      if (changes_ == 0) first_change_ = at;
      last_change_ = at;
      ++changes_;
    }
    since_ = since, ++sets_;
    if (used) recorded_ = true;
    if (used && used->columns() > 0) ++placed_;
  }
  bool recorded() const { return recorded_; }
  std::string text() const {
    const auto shown = [](Duration at) {
      return show_duration(static_cast<std::uint64_t>(std::max<std::int64_t>(0, at.ns())));
    };
    std::string text = fmt::format("placed seams in {} of {}", placed_, counted(sets_, "set"));
    if (changes_ == 0) return text + ", which did not change";
    if (changes_ == 1) return text + ", which changed once, at " + shown(first_change_);
    return text + fmt::format(", which changed {} times, first at {}, last at {}", changes_, shown(first_change_),
                              shown(last_change_));
  }
  Json json() const {
    Json json{{"placed_sets", placed_}, {"changes", changes_}};
    if (changes_ > 0) json["first_change_ns"] = first_change_.ns(), json["last_change_ns"] = last_change_.ns();
    return json;
  }

 private:
  std::optional<std::uint64_t> since_{};  ///< the first set, by the rig's count, with the seams of the set before
  std::uint64_t sets_ = 0;
  std::uint64_t placed_ = 0;
  std::uint64_t changes_ = 0;
  bool recorded_ = false;
  Duration first_change_{}, last_change_{};
};

/// What the evidence says about the sets that a take lacks, and its rates.
class GapSummary {
 public:
  explicit GapSummary(FrameRate otherwise) : otherwise_(otherwise) {}

  /// To be called with the evidence of each segment in turn.
  void add(const take::Segment& segment) {
    std::vector<take::Gap> inside;
    const auto tally = take::tally_of(segment, otherwise_, [&](const take::Gap& gap) { note(inside, gap); });
    if (const auto before = tally_.add(tally)) note(gaps_, *before);
    for (const take::Gap& gap : inside) note(gaps_, gap);
  }
  const take::Tally& tally() const { return tally_; }

  /// `first_ns`: middle of the take's first set.
  std::vector<std::string> lines(std::int64_t first_ns) const {
    std::vector<std::string> lines;
    for (const take::Gap& gap : gaps_) {
      std::string why;
      const auto add = [&](std::uint64_t sets, const char* text) {
        if (sets != 0) why += fmt::format("{}{} {}", why.empty() ? "" : ", ", counted(sets, "set"), text);
      };
      add(gap.slow, "lost: the disk or the board was too slow");
      add(gap.error, "lost by an error of the disk");
      add(gap.capture, "not captured");
      lines.push_back(fmt::format("gap of {} at {}: {}", shown(gap.length.ns()), shown(gap.at_ns - first_ns), why));
    }
    if (tally_.gaps().count > gaps_.size())
      lines.push_back(fmt::format("and {} more", counted(tally_.gaps().count - gaps_.size(), "gap")));
    return lines;
  }
  Json json() const {
    const take::Gaps& all = tally_.gaps();
    Json rates = Json::array();
    for (const take::RateChange& each : tally_.rates())
      rates.push_back({{"set", each.set}, {"rate", {each.rate.numerator, each.rate.denominator}}});
    return {{"rates", rates},
            {"gaps",
             {{"count", all.count},
              {"slow", all.slow},
              {"error", all.error},
              {"capture", all.capture},
              {"longest_ns", all.longest.ns()},
              {"longest_before", all.longest_before}}}};
  }

 private:
  static constexpr std::size_t kShown = 20;
  static void note(std::vector<take::Gap>& gaps, const take::Gap& gap) {
    if (gaps.size() < kShown) gaps.push_back(gap);
  }
  static std::string shown(std::int64_t ns) {
    return show_duration(static_cast<std::uint64_t>(std::max<std::int64_t>(0, ns)));
  }

  const FrameRate otherwise_;
  take::Tally tally_;
  std::vector<take::Gap> gaps_;  ///< the first
};

/// "30000/1001 sets a second", "50 sets a second, from set 312 on 25".
std::string rates_text(const std::vector<take::RateChange>& rates) {
  std::string text;
  for (const take::RateChange& each : rates) {
    const std::string rate = each.rate.denominator == 1
                                 ? std::to_string(each.rate.numerator)
                                 : fmt::format("{}/{}", each.rate.numerator, each.rate.denominator);
    text += text.empty() ? rate + " sets a second" : fmt::format(", from set {} on {}", each.set, rate);
  }
  return text;
}

std::string stored_as(const take::Stream& stream) {
  std::string text = fmt::format("{}x{} {}", stream.width, stream.height, pixel_format_name(stream.format));
  if (stream.lossless) text += " as Ut Video";
  if (stream.fields != Fields::kProgressive) text += fmt::format(", {}", fields_name(stream.fields));
  return text;
}

Status run_show(Context& context, const std::string& name) {
  NODAL_TRY_ASSIGN(const media::TakeFolder folder, open_take(context, name));
  const take::TakeDocument& about = folder.about();
  const take::Manifest& manifest = folder.manifest();

  std::array<HeadSummary, kMaxHeads> heads;
  std::map<std::uint64_t, std::int64_t> starts;  // time of each marked set, ns after the first stored set of the take
  for (const take::Manifest::Mark& mark : manifest.marks) starts[mark.set] = -1;
  media::TakeSets sets(folder);
  media::TakeSet set;
  SeamSummary seams;
  GapSummary gaps(about.rate);
  std::optional<std::uint32_t> segment;
  std::int64_t first = 0;
  for (bool begun = false;; begun = true) {
    NODAL_TRY_ASSIGN(const bool more, sets.next(set));
    if (!more) break;
    if (!begun) first = set.mid_exposure.ns();
    const take::Segment& evidence = sets.segment().evidence();
    if (segment != evidence.begin.segment()) gaps.add(evidence);
    segment = evidence.begin.segment();
    seams.add(evidence, set.evidence.number(), Duration::nanoseconds(set.mid_exposure.ns() - first));
    const auto marked = starts.find(set.evidence.index());
    if (marked != starts.end()) marked->second = set.mid_exposure.ns() - first;
    for (const take::wire::Frame& frame : set.evidence.frames()) {
      const take::StreamFile& file = sets.segment().streams()[frame.file()];
      HeadSummary& head = heads[*file.head];
      head.stored = stored_as(file.stream);
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
  console.line(rates_text(gaps.tally().rates()));
  if (const std::uint64_t lost = manifest.lost_sets - std::min(manifest.lost_sets, manifest.gaps.error); lost != 0) {
    console.line(
        console.paint(Colour::kBad, fmt::format("{} lost: the disk or the board was too slow", counted(lost, "set"))));
  }
  if (manifest.gaps.error != 0) {
    console.line(console.paint(Colour::kBad, counted(manifest.gaps.error, "set") + " lost by an error of the disk"));
  }
  if (const std::uint64_t none = gaps.tally().gaps().capture; none != 0)
    console.line(console.paint(Colour::kBad, counted(none, "set") + " not captured"));
  for (const std::string& line : gaps.lines(first)) console.line(console.paint(Colour::kBad, line));
  if (manifest.deleted_sets != 0) {
    console.line(
        fmt::format("{} deleted by the rig, to make room for newer ones", counted(manifest.deleted_sets, "set")));
  }
  console.line(about.calibration_id.empty() ? "without a calibration"
                                            : "calibration " + about.calibration_id.substr(0, 12));
  for (const take::Manifest::Calibration& each : manifest.calibrations) {
    if (each.stored()) {
      console.line(fmt::format("calibration {} from the rig's set {} on", each.id.substr(0, 12), each.set));
    } else {
      console.line(console.paint(
          Colour::kBad, fmt::format("from the rig's set {} on, calibrations are not in the take: it has as many as it "
                                    "can have; those sets cannot be rendered as they were blended",
                                    each.set)));
    }
    json_calibrations.push_back({{"file", each.file}, {"id", each.id}, {"set", each.set}});
  }
  if (seams.recorded()) {
    console.line(seams.text());
    json["seams"] = seams.json();
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
  json.update(gaps.json());
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
