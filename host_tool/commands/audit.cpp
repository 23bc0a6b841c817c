#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/points_in_time.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

struct AuditOptions {
  std::string since;
};

/// What all replies say together.
struct Log {
  wire::AuditLog newest;  ///< without entries
  std::vector<wire::AuditEntry> entries;
};

Json audit_json(const wire::AuditEntry& entry) {
  Json json{{"number", entry.number()},
            {"at_ns", entry.earlier_run() ? Json() : Json(entry.at_ns())},
            {"utc_ns", entry.utc_ns()},
            {"last_utc_ns", entry.last_utc_ns()},
            {"earlier_run", entry.earlier_run()},
            {"count", std::max<std::uint64_t>(1, entry.count())},
            {"who", entry.who()},
            {"what", entry.what()},
            {"before", entry.before()},
            {"after", entry.after()},
            {"done", !entry.has_error()}};
  if (entry.has_error()) json["error"] = {{"code", entry.error().code()}, {"message", entry.error().message()}};
  return json;
}

/// The newest entries, or all since a time, however many replies they take.
Result<Log> fetch(RigConnection& rig, const std::string& since) {
  Log log;
  wire::Request request;
  request.mutable_audit_log();
  if (!since.empty()) {
    const auto& features = rig.rig().features();
    if (std::ranges::find(features, "audit-since") == features.end()) {
      return fail(Errc::kUnsupported, fmt::format("--since needs a newer nodald on the rig; {} at {} does not have it",
                                                  rig.rig().software(), rig.address()));
    }
    wire::Request now;
    now.mutable_audit_log()->set_after(UINT64_MAX);
    NODAL_TRY_ASSIGN(const wire::Reply clock, rig.ask(now));
    const auto from = parse_point_in_time(since, clock.audit_log().now_utc_ns());
    if (!from) return fail(from.error().in("--since"));
    request.mutable_audit_log()->set_since_utc_ns(*from);
  }
  while (true) {
    NODAL_TRY_ASSIGN(wire::Reply reply, rig.ask(request));
    wire::AuditLog& part = *reply.mutable_audit_log();
    const std::uint64_t before = request.audit_log().after();
    for (wire::AuditEntry& entry : *part.mutable_entries()) {
      if (entry.number() != 0) request.mutable_audit_log()->set_after(entry.number());
      log.entries.push_back(std::move(entry));
    }
    const bool more = part.more() && request.audit_log().after() > before;
    part.clear_entries();
    log.newest = std::move(part);
    if (!more || since.empty()) return log;
  }
}

std::string time_of(const wire::AuditEntry& entry, std::uint64_t now_ns) {
  if (entry.utc_ns() > 0) return show_utc(entry.utc_ns());
  return entry.earlier_run() ? "an earlier run" : show_duration(now_ns - std::min(now_ns, entry.at_ns())) + " ago";
}

std::string result_of(Context& context, const wire::AuditEntry& entry) {
  std::string text = entry.has_error() ? context.console().paint(Colour::kBad, entry.error().message()) : "done";
  if (entry.count() > 1) {
    text += fmt::format("; {} times", entry.count());
    if (entry.last_utc_ns() > 0) text += fmt::format(" until {}", show_utc(entry.last_utc_ns()));
  }
  return text;
}

/// "1", "3-7".
std::string range(std::uint64_t first, std::uint64_t last) {
  return first == last ? fmt::format("{}", first) : fmt::format("{}-{}", first, last);
}

Status run_audit(Context& context, const AuditOptions& options) {
  if (!options.since.empty()) {  // before the rig is asked
    const auto good = parse_point_in_time(options.since, INT64_MAX);
    if (!good) return fail(good.error().in("--since"));
  }
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY_ASSIGN(const Log log, fetch(*rig, options.since));
  Console& console = context.console();
  Json list = Json::array();
  Json gaps = Json::array();
  Table table({{"#", Table::Align::kRight}, {"time (UTC)"}, {"who"}, {"what"}, {"before"}, {"after"}, {"result"}});
  const auto gap = [&](std::uint64_t before_it, std::uint64_t after_it) {
    if (after_it <= before_it + 1) return;
    gaps.push_back({{"first", before_it + 1}, {"last", after_it - 1}});
    table.row(
        {range(before_it + 1, after_it - 1), "", "", "", "", "", console.paint(Colour::kBad, "not stored any more")});
  };
  // Without --since the newest entries are shown, and what is before them was not asked for.
  std::uint64_t before = 0;
  const bool from_oldest = !log.entries.empty() && log.entries.front().number() == log.newest.oldest();
  if (!options.since.empty() && from_oldest) gap(0, log.newest.oldest());
  for (const wire::AuditEntry& entry : log.entries) {
    if (before != 0) gap(before, entry.number());
    before = entry.number() != 0 ? entry.number() : before;
    list.push_back(audit_json(entry));
    table.row({entry.number() == 0 ? "" : std::to_string(entry.number()), time_of(entry, log.newest.now_ns()),
               entry.who(), entry.what(), entry.before(), entry.after(), result_of(context, entry)});
  }
  Json findings = Json::array();
  for (const std::string& finding : log.newest.findings()) findings.push_back(finding);
  console.document({{"now_ns", log.newest.now_ns()},
                    {"now_utc_ns", log.newest.now_utc_ns()},
                    {"newest", log.newest.newest()},
                    {"head", hex_of(log.newest.head())},
                    {"findings", findings},
                    {"problem", log.newest.problem()},
                    {"gaps", gaps},
                    {"entries", list}});
  if (list.empty())
    console.line(options.since.empty() ? "nothing has been changed" : "nothing has been changed since then");
  else
    for (const std::string& line : table.lines()) console.line(line);
  for (const std::string& finding : log.newest.findings()) console.line(console.paint(Colour::kBad, finding));
  if (!log.newest.problem().empty()) {
    console.line(console.paint(Colour::kBad, "the newest entries may not be on the disk: " + log.newest.problem()));
  }
  if (log.newest.newest() != 0) {
    console.line(fmt::format("on the rig's disk up to entry {}, whose hash is {}", log.newest.newest(),
                             hex_of(log.newest.head())));
  }
  return {};
}

}  // namespace

void add_audit(CLI::App& app, CommandLine& line) {
  CLI::App* audit = add_command(app, "audit", "The newest changes of the rig: who made them, old and new values",
                                "  nodal audit\n"
                                "  nodal audit --since 2h\n"
                                "  nodal audit --json | jq '.entries[] | select(.done|not)'\n");
  const auto options = std::make_shared<AuditOptions>();
  audit
      ->add_option("--since", options->since,
                   "All changes since a time ago (90min, 1m, 2h, 3d) or a date in UTC (2026-11-26)")
      ->type_name("TIME");
  line.on(audit, [options](Context& context) { return run_audit(context, *options); });
}

}  // namespace nodal::host
