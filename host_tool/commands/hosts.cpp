#include <fmt/format.h>
#include <fmt/ranges.h>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/not_recorded.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

Json hosts_json(const wire::Hosts& hosts) {
  Json list = Json::array();
  for (const wire::HostState& host : hosts.hosts()) {
    list.push_back({{"number", host.number()},
                    {"peer", host.peer()},
                    {"software", host.software()},
                    {"connected_ns", host.connected_ns()},
                    {"idle_ns", host.idle_ns()},
                    {"streams", Json(std::vector<std::string>(host.streams().begin(), host.streams().end()))},
                    {"bytes_in", host.bytes_in()},
                    {"bytes_out", host.bytes_out()},
                    {"dropped", host.dropped()},
                    {"asking", host.asking()}});
  }
  return {{"hosts", list}};
}

void show(Console& console, const wire::Hosts& hosts) {
  using Align = Table::Align;
  Table table({{"#", Align::kRight},
               {"peer"},
               {"program"},
               {"connected", Align::kRight},
               {"idle", Align::kRight},
               {"in", Align::kRight},
               {"out", Align::kRight},
               {"dropped", Align::kRight},
               {"does"}});
  for (const wire::HostState& host : hosts.hosts()) {
    const std::string does = host.asking() ? "asks this" : fmt::format("{}", fmt::join(host.streams(), ", "));
    table.row({std::to_string(host.number()), host.peer(), host.software().empty() ? "no hello yet" : host.software(),
               show_duration(host.connected_ns()), show_duration(host.idle_ns()), show_bytes(host.bytes_in()),
               show_bytes(host.bytes_out()), std::to_string(host.dropped()), does});
  }
  for (const std::string& line : table.lines()) console.line(line);
}

Status run_hosts(Context& context, std::uint64_t end) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  wire::Request request;
  if (end == 0) request.mutable_hosts();
  else request.mutable_host_end()->set_number(end);
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig->ask(request));
  if (end != 0) {
    note_not_recorded(context.console(), reply);
    context.console().line(fmt::format("host {} is being disconnected", end));
    context.console().document({{"ended", end}, {"done", true}});
    return {};
  }
  context.console().document(hosts_json(reply.hosts()));
  show(context.console(), reply.hosts());
  return {};
}

}  // namespace

void add_hosts(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      add_command(app, "hosts", "List the hosts that are connected to the rig and what each receives; disconnect one",
                  "  nodal hosts\n"
                  "  nodal hosts --end 3\n"
                  "  nodal hosts --json | jq '.hosts[] | select(.idle_ns > 60e9) | .number'\n");
  auto end = std::make_shared<std::uint64_t>(0);
  command->add_option("--end", *end, "Disconnect the host with this number")
      ->type_name("N")
      ->check(CLI::PositiveNumber);
  line.on(command, [end](Context& context) { return run_hosts(context, *end); });
}

}  // namespace nodal::host
