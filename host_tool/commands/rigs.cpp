// `rigs`: which rigs there are.
#include "host_tool/commands/rigs.h"

#include <memory>

#include "host_tool/commands/command_list.h"
#include "host_tool/console/quantities.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

Status run_rigs(Context& context) {
  if (context.found_rigs == nullptr) {
    NODAL_TRY(prepare_rigs(context));
  }
  Console& console = context.console();
  Json list = Json::array();
  Table table({{"rig"}, {"--rig"}, {"page"}});
  for (const FoundRig& rig : context.found_rigs->rigs) {
    list.push_back({{"name", rig.name}, {"address", rig.address}, {"page", rig.page}});
    table.row({rig.name, rig.address, rig.page});
  }
  console.document({{"rigs", list}, {"notes", context.found_rigs->notes}});
  if (!list.empty()) {
    for (const std::string& line : table.lines()) console.line(line);
  }
  for (const std::string& note : context.found_rigs->notes) console.note(note);
  if (list.empty())
    console.note("No rig was found. One behind ssh needs no announcement: nodal --rig ssh://HOST status");
  return {};
}

}  // namespace

Status prepare_rigs(Context& context) {
  NODAL_TRY_ASSIGN(const Duration at_most, parse_duration(context.timeout));
  context.found_rigs = std::make_shared<FoundRigs>(find_rigs(at_most));
  return {};
}

void add_rigs(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      add_command(app, kRigsCommand, "List rigs: on USB cables, and those that announce themselves",
                  "  nodal rigs\n"
                  "  nodal rigs --json\n"
                  "A rig announces itself when its page for phones is enabled: nodal-web front enable.\n"
                  "The network is searched by avahi-browse (Debian's avahi-utils).\n");
  line.on(command, run_rigs);
}

}  // namespace nodal::host
