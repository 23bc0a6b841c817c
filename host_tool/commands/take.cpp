#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <memory>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/console/points_in_time.h"
#include "host_tool/console/quantities.h"
#include "host_tool/offload/take_fetch.h"
#include "host_tool/offload/take_json.h"
#include "host_tool/rig/not_recorded.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/try.h"
#include "protocol/take/evidence.h"

namespace nodal::host {
namespace {

constexpr std::size_t kMaxThumbnailBytes = 4 << 20;

struct TakeOptions {
  std::uint64_t take = 0;
  std::string text;
  std::string thumbnails;
  bool off = false;
  bool yes = false;
};

/// Why sets are missing, and pictures of which heads: ", 150 sets not captured (the longest gap has 5.0 s)"; empty:
/// nothing is.
std::string missing_text(const wire::TakeEntry& take) {
  std::string text;
  const auto add = [&](std::uint64_t sets, const char* why) {
    if (sets != 0) text += fmt::format(", {} {}", counted(sets, "set"), why);
  };
  add(take.lost_sets() - std::min(take.lost_sets(), take.lost_by_errors()), "lost by a slow disk");
  add(take.lost_by_errors(), "lost by errors of the disk");
  add(take.not_captured(), "not captured");
  if (take.longest_gap_ns() != 0)
    text += fmt::format(" (the longest gap has {})", show_duration(take.longest_gap_ns()));
  for (int head = 0; head < take.missing_pictures_size(); ++head) {
    if (take.missing_pictures(head) == 0) continue;
    text += fmt::format(", {} of head {} missing", counted(take.missing_pictures(head), "picture"), head);
  }
  return text;
}

/// Writes a take's thumbnail as DIR/000042.jpg, and returns that name; empty: it has none.
Result<std::string> store_thumbnail(RigConnection& rig, const wire::TakeEntry& take, const std::string& folder) {
  if (take.width() == 0 || take.state() != "complete") return std::string();
  const auto bytes = fetch_small_file(rig, take.number(), take::kThumbFile, kMaxThumbnailBytes);
  if (!bytes && bytes.error().code == Errc::kNotFound) return std::string();
  if (!bytes) return fail(bytes.error());
  const std::string name = fmt::format("{}/{}.jpg", folder, take::take_folder(take.number()));
  NODAL_TRY(write_file(name, *bytes));
  return name;
}

Status list_takes(Context& context, const TakeOptions& options) {
  wire::Request request;
  request.mutable_take_list();
  NODAL_TRY_ASSIGN(const std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig->ask(request));
  if (!options.thumbnails.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.thumbnails, error);
    if (error) return fail(Errc::kIo, fmt::format("folder '{}': {}", options.thumbnails, error.message()));
  }
  Json list = Json::array();
  Table table({{"take", Table::Align::kRight},
               {"started (UTC)"},
               {"length", Table::Align::kRight},
               {"sets", Table::Align::kRight},
               {"lost", Table::Align::kRight},
               {"size", Table::Align::kRight},
               {"state"}});
  for (const wire::TakeEntry& take : reply.takes().takes()) {
    list.push_back(to_json(take));
    if (!options.thumbnails.empty()) {
      NODAL_TRY_ASSIGN(const std::string stored, store_thumbnail(*rig, take, options.thumbnails));
      list.back()["thumbnail"] = stored.empty() ? Json() : Json(stored);
    }
    std::string state = take.state();
    if (!take.ended().empty() && take.ended() != "stopped") state += ", " + take.ended();
    if (take.deleted_sets() != 0) state += ", without the " + counted(take.deleted_sets(), "set") + " deleted for room";
    state += missing_text(take);
    if (take.is_protected()) state += ", protected";
    if (!take.problem().empty()) state += ": " + context.console().paint(Colour::kBad, take.problem());
    table.row({std::to_string(take.number()), show_utc(take.started_utc_ns()), show_duration(take.length_ns()),
               std::to_string(take.sets()), std::to_string(take.lost_sets() + take.not_captured()),
               show_bytes(take.bytes()), state});
  }
  context.console().document({{"takes", list}});
  if (list.empty()) {
    context.console().line("there are no takes; record one: nodal take start");
    return {};
  }
  for (const std::string& line : table.lines()) context.console().line(line);
  return {};
}

/// Sends the request; the line names the take that the rig answers with. `for_a_set`: the answer comes after the next
/// frame sets, which at a low rate takes longer than --timeout.
Status ask_about_take(Context& context, const wire::Request& request, const char* done, bool for_a_set = false) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY_ASSIGN(const wire::Reply reply,
                   for_a_set ? rig->ask_long(request, [](const wire::RigStatus&) {}) : rig->ask(request));
  note_not_recorded(context.console(), reply);
  context.console().document({{"take", reply.take().take()}});
  context.console().line(fmt::format(fmt::runtime(done), reply.take().take()));
  return {};
}

Status run_start(Context& context) {
  wire::Request request;
  request.mutable_take_start();
  return ask_about_take(context, request, "take {} is being recorded; end it: nodal take stop");
}

Status run_still(Context& context) {
  wire::Request request;
  request.mutable_take_start()->set_still(true);
  return ask_about_take(context, request, "take {} is a still: one set, on the disk", true);
}

Status run_stop(Context& context) {
  wire::Request request;
  request.mutable_take_stop();
  return ask_about_take(context, request, "take {} is finished and on the disk");
}

Status run_mark(Context& context, const TakeOptions& options) {
  wire::Request request;
  request.mutable_take_mark()->set_text(options.text);
  return ask_about_take(context, request, "marked in take {}");
}

/// Asks a person whether this is the take that was meant.
Status confirm_deletion(Context& context, std::uint64_t number) {
  wire::Request request;
  request.mutable_take_list();
  NODAL_TRY_ASSIGN(const wire::Reply reply, context.ask(request));
  for (const wire::TakeEntry& take : reply.takes().takes()) {
    if (take.number() != number) continue;
    const bool sure = context.console().confirmed(fmt::format(
        "take {} ({}, {}, {}) is deleted from the rig's disk for good; copies elsewhere stay. Delete it?", number,
        show_utc(take.started_utc_ns()), show_duration(take.length_ns()), show_bytes(take.bytes())));
    return sure ? Status() : fail(Errc::kCancelled, fmt::format("take {} was not deleted", number));
  }
  return {};  // the rig says that there is none
}

Status run_delete(Context& context, const TakeOptions& options) {
  if (!options.yes) NODAL_TRY(confirm_deletion(context, options.take));
  wire::Request request;
  request.mutable_take_delete()->set_take(options.take);
  return ask_about_take(context, request, "take {} is deleted");
}

Status run_protect(Context& context, const TakeOptions& options) {
  wire::Request request;
  request.mutable_take_protect()->set_take(options.take);
  request.mutable_take_protect()->set_on(!options.off);
  return ask_about_take(context, request, options.off ? "take {} can be deleted" : "take {} is protected");
}

}  // namespace

void add_take(CLI::App& app, CommandLine& line) {
  CLI::App* take = add_command(app, "take", "Record every head on the rig's disk", "");
  take->require_subcommand(1);
  CLI::App* start = add_command(*take, "start", "Begin a take: every head, the raymaps and the evidence of their times",
                                "  nodal take start\n");
  line.on(start, run_start);
  CLI::App* stop =
      add_command(*take, "stop", "End the take; returns when its files are safe on the disk", "  nodal take stop\n");
  line.on(stop, run_stop);
  CLI::App* still = add_command(*take, "still", "A take of one set, with every head; returns when it is on the disk",
                                "  nodal take still\n");
  line.on(still, run_still);
  auto marked = std::make_shared<TakeOptions>();
  CLI::App* mark = add_command(*take, "mark", "Mark this moment in the take that is being recorded",
                               "  nodal take mark \"the bus passes\"\n");
  mark->add_option("TEXT", marked->text, "What happens; at most 200 bytes")->type_name("");
  line.on(mark, [marked](Context& context) { return run_mark(context, *marked); });
  CLI::App* list = add_command(*take, "list", "The takes on the rig's disk",
                               "  nodal take list\n"
                               "  nodal take list --thumbnails pictures     pictures/000042.jpg, ...\n"
                               "  nodal take list --json | jq '.takes[] | select(.lost_sets>0)'\n");
  auto listed = std::make_shared<TakeOptions>();
  list->add_option("--thumbnails", listed->thumbnails, "Write a small raymap of each take, where it has any")
      ->type_name("DIR");
  line.on(list, [listed](Context& context) { return list_takes(context, *listed); });
  add_take_show(*take, line);
  add_take_verify(*take, line);
  add_take_export(*take, line);
  auto deleted = std::make_shared<TakeOptions>();
  CLI::App* remove = add_command(*take, "delete", "Delete a take from the rig's disk; on a terminal it asks first",
                                 "  nodal take delete 42\n");
  remove->add_option("TAKE", deleted->take, "Number of the take")->required()->type_name("");
  remove->add_flag("-y,--yes", deleted->yes, "Do not ask");
  line.on(remove, [deleted](Context& context) { return run_delete(context, *deleted); });
  auto kept = std::make_shared<TakeOptions>();
  CLI::App* protect = add_command(*take, "protect", "Protect a take from being deleted",
                                  "  nodal take protect 42\n"
                                  "  nodal take protect 42 --off\n");
  protect->add_option("TAKE", kept->take, "Number of the take")->required()->type_name("");
  protect->add_flag("--off", kept->off, "Allow the take to be deleted again");
  line.on(protect, [kept](Context& context) { return run_protect(context, *kept); });
}

}  // namespace nodal::host
