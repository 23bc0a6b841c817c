#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <chrono>
#include <optional>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/output/raymap_sink.h"
#include "host_tool/rig/frame_period.h"
#include "host_tool/rig/received_raymap.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

struct RaymapArgs {
  std::uint64_t count = 1;
  bool continuous = false;
  bool lossless = false;
  bool complete = false;
  std::string seconds;
  std::string out;
  std::string format;
};

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

Result<std::uint64_t> parse_count(std::string_view text) {
  std::uint64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (error != std::errc() || end != text.data() + text.size() || count == 0) {
    return fail(Errc::kBadValue, fmt::format("count '{}': 1 or more; --continuous goes on until Ctrl-C", text));
  }
  return count;
}

/// The counters of a pull.
struct Tally {
  std::uint64_t pulled = 0;
  std::uint64_t incomplete = 0;  ///< skipped, because they lack a head
  std::uint64_t dropped = 0;
  std::uint64_t bytes = 0;
  double first_s = 0;
  double last_s = 0;
  std::uint64_t first_exposure_ns = 0;
  std::uint64_t last_exposure_ns = 0;
  std::uint64_t worst_spread_ns = 0;

  void add(const media::Raymap& raymap) {
    last_s = now_s();
    last_exposure_ns = raymap.meta.mid_exposure_ns;
    if (pulled == 0) {
      first_s = last_s;
      first_exposure_ns = last_exposure_ns;
    }
    ++pulled;
    bytes += raymap.bytes.size();
    worst_spread_ns = std::max(worst_spread_ns, raymap.meta.spread_ns);
  }
  /// Received raymaps per second; 0 for fewer than two.
  double rate() const {
    return pulled < 2 || last_s <= first_s ? 0 : static_cast<double>(pulled - 1) / (last_s - first_s);
  }
};

Result<RaymapSink> make_sink(const RaymapArgs& args, Console& console) {
  if (has_ending(args.out, ".mkv")) {
    if (!args.format.empty() && args.format != "jpg") {
      return fail(Errc::kBadValue, "--format " + args.format + ": a film (.mkv) is of JPEGs; leave it out");
    }
    return RaymapSink::film_of(args.out);
  }
  RaymapSink sink;
  if (!args.format.empty()) {
    sink.format = media::parse_raymap_format(args.format).value_or(media::RaymapFormat::kJpg);
  } else if (!args.out.empty() && args.out != "-") {
    const Result<media::RaymapFormat> format = media::raymap_format_of_name(args.out);
    if (!format) return fail(format.error().code, "--out " + format.error().message + ", or say --format");
    sink.format = *format;
  }
  const bool many = args.continuous || args.count != 1 || !args.seconds.empty();
  const std::string end(media::ending_of(sink.format));
  sink.pattern = !args.out.empty() ? args.out : (many ? "raymap-%06d." : "raymap.") + end;
  if (sink.pattern == "-") {
    NODAL_TRY(check_pipe(console));
    return sink;
  }
  if (const Result<std::string> name = numbered_name(sink.pattern, 1); !name) return fail(name.error().in("--out"));
  if (many && !has_number(sink.pattern)) console.note(sink.pattern + " holds the newest raymap only; %06d keeps all");
  return sink;
}

void tell_frame(Console& console, const media::Raymap& raymap, const std::string& name, std::uint64_t dropped) {
  Json json = media::to_json(raymap.meta);
  json["file"] = name;
  json["bytes"] = raymap.bytes.size();
  json["dropped"] = dropped;
  console.document({{"raymap", json}});
}

void tell_summary(Console& console, const Tally& tally, const std::string& last_name) {
  console.document({{"summary",
                     {{"pulled", tally.pulled},
                      {"incomplete", tally.incomplete},
                      {"dropped", tally.dropped},
                      {"bytes", tally.bytes},
                      {"rate", tally.rate()},
                      {"seconds", tally.last_s - tally.first_s},
                      {"exposure_seconds", static_cast<double>(tally.last_exposure_ns - tally.first_exposure_ns) / 1e9},
                      {"worst_spread_ns", tally.worst_spread_ns}}}});
  if (last_name == "-") return;  // standard output contains pictures
  std::string text =
      fmt::format("{} raymap{} ({})", tally.pulled, tally.pulled == 1 ? "" : "s", show_bytes(tally.bytes));
  if (tally.pulled > 1) {
    text += fmt::format(", {:.2f} a second, {} dropped on the way, worst spread {}", tally.rate(), tally.dropped,
                        show_duration(tally.worst_spread_ns));
  }
  if (tally.incomplete != 0) text += fmt::format(", {} skipped because a head is missing", tally.incomplete);
  console.line(fmt::format("{}; {} {}", text, has_ending(last_name, ".mkv") ? "in" : "the last is", last_name));
}

/// One pull, from its first piece to its summary.
class Pull {
 public:
  Pull(RigConnection& rig, StreamId stream, const RaymapArgs& args, const RaymapSink& sink, int heads, Console& console)
      : rig_(rig),
        stream_(stream),
        args_(args),
        sink_(sink),
        heads_(heads),
        console_(console),
        endless_(args.continuous || !args.seconds.empty()),
        progress_(console, "raymap", endless_ ? 0 : args.count),
        floor_(rig.patience(), rig.now()),
        assembly_(sink.format == media::RaymapFormat::kJpg ? "jpeg" : "") {}

  /// Runs until there are enough raymaps, the time is up, Ctrl-C, or the rig closes the stream.
  Status run() {
    NODAL_TRY_ASSIGN(const Duration period, frame_period(rig_));
    const Duration remind_after = kRemindAfter.at(period);
    const double until =
        args_.seconds.empty() ? 0 : now_s() + static_cast<double>(parse_duration(args_.seconds)->ns()) / 1e9;
    while (!enough() && (until == 0 || now_s() < until) && !console_.output_gone()) {
      const Result<std::optional<Event>> event = rig_.next_event_of(stream_, remind_after);
      if (interrupted()) break;
      if (!event) return fail(event.error());
      const bool moves = floor_.moved_to(rig_.received(stream_), rig_.now());
      if (begun_ && floor_.stalled(rig_.now())) {
        return fail(Errc::kTimeout, fmt::format("{}: the rig began a raymap and sent less than {} of it in {}",
                                                rig_.address(), show_bytes(kMinBytesAWindow),
                                                show_duration(static_cast<std::uint64_t>(floor_.window().ns()))));
      }
      if (!*event && moves) continue;
      if (!*event) {
        console_.note(fmt::format("no raymap for {}; `nodal status` says why (no calibration? genlock stopped?)",
                                  show_duration(static_cast<std::uint64_t>(remind_after.ns()))));
        continue;
      }
      NODAL_TRY_ASSIGN(const bool more, take(**event));
      if (!more) break;
    }
    rig_.stop_stream(stream_);
    console_.finish_progress();
    if (sink_.film) {
      NODAL_TRY(sink_.film->film().end());
    }
    return conclude(args_.seconds.empty() || now_s() < until);
  }

 private:
  static constexpr FrameTime kRemindAfter{Duration::seconds(10), 4};

  /// Prints the summary. Ctrl-C is the normal end of --continuous; with any other pull it means incomplete (`early`).
  Status conclude(bool early) {
    if (tally_.pulled != 0) tell_summary(console_, tally_, name_);
    if (interrupted() && !args_.continuous && !enough() && early) {
      const std::string wanted = endless_ ? args_.seconds : fmt::format("{} raymaps", args_.count);
      return fail(Errc::kCancelled, fmt::format("stopped by a signal after {} raymap{}; {} were asked for",
                                                tally_.pulled, tally_.pulled == 1 ? "" : "s", wanted));
    }
    if (tally_.pulled != 0 || console_.output_gone()) return {};
    return fail(interrupted() ? Errc::kCancelled : Errc::kNotReady,
                tally_.incomplete != 0 ? fmt::format("{} raymaps came, and a head was missing in each; `nodal heads` "
                                                     "says which",
                                                     tally_.incomplete)
                                       : "no raymap came; `nodal status` says what the rig is doing");
  }

  bool enough() const { return !endless_ && tally_.pulled >= args_.count; }

  /// Handles an event; returns whether the stream continues.
  Result<bool> take(const Event& event) {
    if (const auto* closed = std::get_if<StreamClosed>(&event)) {
      tally_.dropped = closed->dropped;
      if (closed->error) return fail(*closed->error);
      if (endless_) return false;
      return fail(Errc::kLinkClosed,
                  fmt::format("the rig ended the stream after {} of {} raymaps", tally_.pulled, args_.count));
    }
    const auto* piece = std::get_if<BulkPiece>(&event);
    if (piece == nullptr) return true;
    tally_.dropped = piece->dropped;
    if (piece->first) floor_.restart(rig_.now());
    begun_ = !piece->last;
    NODAL_TRY_ASSIGN(const std::optional<media::Raymap> raymap, assembly_.add(*piece));
    if (!raymap) return true;
    NODAL_TRY(keep(*raymap));
    return true;
  }

  Status keep(const media::Raymap& raymap) {
    NODAL_TRY(check_raymap(raymap));
    if (args_.complete && std::popcount(raymap.meta.heads_mask) < heads_) {
      ++tally_.incomplete;
      return {};
    }
    tally_.add(raymap);
    NODAL_TRY_ASSIGN(const std::string stored, sink_.store(raymap, tally_.pulled, console_));
    name_ = stored;
    tell_frame(console_, raymap, name_, tally_.dropped);
    progress_.update(tally_.pulled,
                     fmt::format("{:.2f}/s, {} dropped, set {}", tally_.rate(), tally_.dropped, raymap.meta.set));
    return {};
  }

  RigConnection& rig_;
  StreamId stream_;
  const RaymapArgs& args_;
  const RaymapSink& sink_;
  int heads_;
  Console& console_;
  bool endless_;
  Progress progress_;
  Tally tally_;
  ProgressFloor floor_;  ///< least progress of a raymap whose first piece has arrived
  bool begun_ = false;
  RaymapAssembly assembly_;
  std::string name_;
};

/// The number of the rig's heads, for --complete.
Result<int> count_heads(RigConnection& rig) {
  wire::Request request;
  request.mutable_heads();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  return reply.heads().heads_size();
}

/// Requests raymaps; repeats the request every second while the rig is still compiling its blend table.
Result<StreamId> start_pull(RigConnection& rig, const wire::Request& request, Console& console) {
  constexpr Duration kAskAgainAfter = Duration::seconds(1);
  ActivityFloor floor(rig.now());
  while (true) {
    const Result<wire::Reply> started = rig.ask(request);
    if (started) {
      console.finish_progress();
      return StreamId{started->pull().stream()};
    }
    if (started.error().code != Errc::kNotReady) return fail(started.error());
    wire::Request how;
    how.mutable_status();
    NODAL_TRY_ASSIGN(const wire::Reply status, rig.ask(how));
    floor.see(status.status().activity(), rig.now());
    if (status.status().activity().empty() || floor.stalled(rig.now())) return fail(started.error());
    console.activity(status.status().activity());
    NODAL_TRY(rig.rest(kAskAgainAfter));
    if (interrupted()) return fail(Errc::kCancelled, "stopped while the rig was " + status.status().activity());
  }
}

Status run_raymap(Context& context, const RaymapArgs& args) {
  NODAL_TRY_ASSIGN(const RaymapSink sink, make_sink(args, context.console()));
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY_ASSIGN(const int heads, args.complete ? count_heads(*rig) : 0);
  wire::Request request;
  wire::PullRequest& wanted = *request.mutable_pull();
  wanted.set_coding(sink.format == media::RaymapFormat::kJpg ? wire::PullRequest::JPEG : wire::PullRequest::RAW);
  wanted.set_count(0);  // this end counts and stops: dropped raymaps must not count
  wanted.set_lossless(args.lossless);
  NODAL_TRY_ASSIGN(const StreamId stream, start_pull(*rig, request, context.console()));
  return Pull(*rig, stream, args, sink, heads, context.console()).run();
}

}  // namespace

void add_raymap(CLI::App& app, CommandLine& line) {
  CLI::App* raymap = add_command(app, "raymap", "Raymaps: the stitched sphere", "");
  raymap->require_subcommand(1);
  CLI::App* command = add_command(*raymap, "pull", "Save raymaps as files as the rig makes them",
                                  "  nodal raymap pull                            raymap.jpg\n"
                                  "  nodal raymap pull -n 100 --out r-%04d.png\n"
                                  "  nodal raymap pull --continuous --out live.jpg    always the newest\n"
                                  "  nodal raymap pull --for 10m --lossless --out film.mkv   a film\n"
                                  "  nodal raymap pull --continuous --out - | ffplay -f mjpeg -\n"
                                  "With --json: one document a raymap, and one with the sum at the end.\n");
  auto args = std::make_shared<RaymapArgs>();
  CLI::Option* count = command->add_option("-n,--count", args->count, "Number of raymaps (1 when not given)")
                           ->type_name("N")
                           ->check(checked_by(parse_count));
  CLI::Option* continuous = command->add_flag("--continuous", args->continuous, "Continue until Ctrl-C");
  CLI::Option* seconds = command->add_option("--for", args->seconds, "Continue for this long, such as 10s")
                             ->type_name("DURATION")
                             ->check(checked_by(parse_duration));
  count->excludes(continuous)->excludes(seconds);
  continuous->excludes(seconds);
  command
      ->add_option("-o,--out", args->out, "File; %06d is replaced by the number, .mkv is a film, - is standard output")
      ->type_name("PATTERN");
  command
      ->add_option("--format", args->format,
                   "jpg as received, png, or raw with a .json file beside it; default: by --out")
      ->type_name("jpg|png|tif|raw")
      ->check(checked_by(media::parse_raymap_format));
  command->add_flag("--complete", args->complete, "Only raymaps with pictures of every head of the rig");
  command->add_flag("--lossless", args->lossless,
                    "Every raymap that the rig makes, or an error if this computer is too slow");
  line.on(command, [args](Context& context) { return run_raymap(context, *args); });
}

}  // namespace nodal::host
