// `nodal offload`: takes from the rig's disk to a folder.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/offload/take_copy.h"
#include "protocol/base/try.h"
#include "protocol/upload.h"

namespace nodal::host {
namespace {

struct OffloadOptions {
  std::vector<std::uint64_t> takes;
  bool all_new = false;
  std::string to;
  std::string only;
  bool delete_after = false;
};

Result<std::vector<std::uint64_t>> wanted_takes(RigConnection& rig, const OffloadOptions& options) {
  if (!options.all_new) return options.takes;
  wire::Request request;
  request.mutable_take_list();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  std::vector<std::uint64_t> takes;
  for (const wire::TakeEntry& take : reply.takes().takes()) {
    if (take.state() == "complete") takes.push_back(take.number());
  }
  return takes;
}

Error advised(Error error) {
  if (error.code == Errc::kCancelled || error.code == Errc::kLinkClosed || error.code == Errc::kTimeout ||
      error.code == Errc::kUnreachable || error.code == Errc::kDiskFull) {
    error.message += "; the same command goes on where this one ended";
  }
  return error;
}

/// Copies one take. `json`, which has its number, gets what `nodal offload --json` says of a take that is copied, also
/// if it then cannot be deleted.
Status offload(Context& context, RigConnection& rig, std::uint64_t take, const OffloadOptions& options, Json& json) {
  const bool without_heads = !options.only.empty();
  NODAL_TRY_ASSIGN(auto copy, TakeCopy::begin(rig, take, options.to));
  const bool was_there = copy.complete();
  if (!was_there) {
    Progress progress(context.console(), fmt::format("take {}", take), copy.bytes(without_heads));
    NODAL_TRY(
        copy.run(without_heads, [&](std::uint64_t bytes, const std::string& file) { progress.update(bytes, file); }));
  }
  json["id"] = to_hex(copy.id());
  json["folder"] = copy.folder().string();
  json["bytes"] = copy.bytes(without_heads);
  json["fetched"] = copy.fetched();
  json["whole"] = !without_heads;
  json["deleted"] = false;
  std::string what =
      was_there ? "was there already" : fmt::format("{} copied and verified", show_bytes(copy.bytes(without_heads)));
  if (options.delete_after) {
    wire::Request request;
    request.mutable_take_delete()->set_take(take);
    request.mutable_take_delete()->set_manifest_sha256(sha256_to_wire(copy.id()));
    const Result<wire::Reply> deleted = rig.ask(request);
    if (!deleted) {
      context.console().line(fmt::format("take {}: {}: {}", take, what, copy.folder().string()));
      return fail(deleted.error().in("it is not deleted"));
    }
    what += ", deleted from the rig";
    json["deleted"] = true;
  }
  context.console().line(fmt::format("take {}: {}: {}", take, what, copy.folder().string()));
  return {};
}

Status run_offload(Context& context, const OffloadOptions& options) {
  watch_interrupts();
  NODAL_TRY_ASSIGN(auto rig, context.connect());
  NODAL_TRY_ASSIGN(const auto takes, wanted_takes(*rig, options));
  Json done = Json::array(), failed = Json::array();
  std::optional<Error> problem;
  for (const std::uint64_t take : takes) {
    Json json{{"take", take}};
    const Status copied = offload(context, *rig, take, options, json);
    if (json.contains("id")) done.push_back(json);
    if (copied) continue;
    Error error = advised(copied.error().in(fmt::format("take {}", take)));
    failed.push_back({{"take", take}, {"error", error.message}});
    // What concerns one take does not keep the others on the rig.
    const bool of_this_take = error.code == Errc::kNotFound || error.code == Errc::kWrongState ||
                              error.code == Errc::kChecksum || error.code == Errc::kBadFormat;
    if (problem) context.console().warning(problem->message);
    problem = std::move(error);
    if (!of_this_take) break;
  }
  context.console().document({{"takes", done}, {"failed", failed}});  // also what was done before an error
  if (problem) return fail(*problem);
  if (takes.empty()) context.console().line("there are no finished takes; `nodal take list` lists them");
  return {};
}

}  // namespace

void add_offload(CLI::App& app, CommandLine& line) {
  auto options = std::make_shared<OffloadOptions>();
  CLI::App* offload =
      add_command(app, "offload", "Copy takes from the rig's disk, verified byte by byte",
                  "  nodal offload 42 --to /media/disk\n"
                  "  nodal --rig usb: offload --new --to /media/disk --delete\n"
                  "  nodal offload 42 --to . --only raymap         the film of the sphere, without the heads\n"
                  "Each MiB is compared with the hash that the rig stored when it was recorded. Whatever\n"
                  "interrupts the copy, the same command goes on where it ended. Recording has priority: a\n"
                  "rig that records sends only while its disk has time.\n");
  auto* takes = offload->add_option("TAKE", options->takes, "Numbers of takes")->type_name("");
  auto* all_new = offload->add_flag("--new", options->all_new, "Every finished take that the folder does not have");
  offload->add_option("--to", options->to, "The folder; each take becomes a folder in it, such as 000042")
      ->required()
      ->type_name("FOLDER");
  auto* only = offload->add_option("--only", options->only, "Leave out the heads' pictures")
                   ->type_name("raymap")
                   ->check(CLI::IsMember({"raymap"}));
  offload
      ->add_flag("--delete", options->delete_after,
                 "Delete each take from the rig when all of it is on this disk; a protected take stays")
      ->excludes(only);
  takes->excludes(all_new);
  offload->parse_complete_callback([options] {
    if (options->takes.empty() && !options->all_new) throw CLI::RequiredError("TAKE (nodal take list), or --new");
  });
  line.on(offload, [options](Context& context) { return run_offload(context, *options); });
}

}  // namespace nodal::host
