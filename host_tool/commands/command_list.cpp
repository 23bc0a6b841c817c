#include "host_tool/commands/command_list.h"

#include <initializer_list>
#include <string>
#include <vector>

namespace nodal::host {
namespace {

using Adders = std::initializer_list<void (*)(CLI::App&, CommandLine&)>;

/// Adds commands that --help lists under one heading.
void add_group(CLI::App& app, CommandLine& line, const std::string& heading, Adders adders) {
  const auto all = [](const CLI::App*) { return true; };
  const std::size_t before = app.get_subcommands(all).size();
  for (const auto& add : adders) add(app, line);
  const std::vector<CLI::App*> commands = app.get_subcommands(all);
  for (std::size_t k = before; k < commands.size(); ++k) commands[k]->group(heading);
}

}  // namespace

void add_all_commands(CLI::App& app, CommandLine& line) {
  add_group(app, line, "Spheres from pictures and films",
            {add_stitch, add_render, add_convert, add_view, add_look, add_mesh});
  add_group(app, line, "Lenses and directions",
            {add_register, add_drift, add_calibration, add_calibrate, add_pattern, add_pairs, add_import, add_export});
  add_group(app, line, "A rig",
            {add_rigs, add_status, add_heads, add_exposure, add_genlock, add_raymap, add_take, add_offload, add_disk,
             add_web, add_hosts, add_audit, add_sync});
  add_group(app, line, "Other", {add_completion});
}

}  // namespace nodal::host
