#include <fmt/format.h>

#include "host_tool/commands/command.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/wire_json.h"

namespace nodal::host {
namespace {

Json audit_json(const wire::AuditEntry& entry) {
  Json json{{"number", entry.number()}, {"at_ns", entry.at_ns()}, {"who", entry.who()},        {"what", entry.what()},
            {"before", entry.before()}, {"after", entry.after()}, {"done", !entry.has_error()}};
  if (entry.has_error()) json["error"] = {{"code", entry.error().code()}, {"message", entry.error().message()}};
  return json;
}

Status run_audit(Context& context) {
  wire::Request request;
  request.mutable_audit_log();
  const Result<wire::Reply> reply = context.ask(request);
  if (!reply) return fail(reply.error());
  const wire::AuditLog& log = reply->audit_log();
  Json list = Json::array();
  Table table({{"#", Table::Align::kRight},
               {"ago", Table::Align::kRight},
               {"who"},
               {"what"},
               {"before"},
               {"after"},
               {"result"}});
  for (const wire::AuditEntry& entry : log.entries()) {
    list.push_back(audit_json(entry));
    table.row({std::to_string(entry.number()), show_duration(log.now_ns() - entry.at_ns()), entry.who(), entry.what(),
               entry.before(), entry.after(),
               entry.has_error() ? context.console().paint(Colour::kBad, entry.error().message()) : "done"});
  }
  context.console().document({{"now_ns", log.now_ns()}, {"entries", list}});
  if (list.empty()) {
    context.console().line("nothing has been changed since the rig started");
    return {};
  }
  for (const std::string& line : table.lines()) context.console().line(line);
  return {};
}

}  // namespace

void add_audit(CLI::App& app, CommandLine& line) {
  CLI::App* audit = add_command(app, "audit", "The newest changes of the rig: who made them, old and new values",
                                "  nodal audit\n"
                                "  nodal audit --json | jq '.entries[] | select(.done|not)'\n");
  line.on(audit, run_audit);
}

}  // namespace nodal::host
