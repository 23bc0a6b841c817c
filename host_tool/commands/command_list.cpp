#include "host_tool/commands/command_list.h"

namespace nodal::host {

void add_all_commands(CLI::App& app, CommandLine& line) {
  add_rigs(app, line);
  add_status(app, line);
  add_heads(app, line);
  add_hosts(app, line);
  add_take(app, line);
  add_offload(app, line);
  add_disk(app, line);
  add_exposure(app, line);
  add_genlock(app, line);
  add_calibration(app, line);
  add_audit(app, line);
  add_sync(app, line);
  add_raymap(app, line);
  add_stitch(app, line);
  add_render(app, line);
  add_convert(app, line);
  add_view(app, line);
  add_look(app, line);
  add_web(app, line);
  add_mesh(app, line);
  add_import(app, line);
  add_pairs(app, line);
  add_register(app, line);
  add_drift(app, line);
  add_export(app, line);
  add_pattern(app, line);
  add_calibrate(app, line);
  add_completion(app, line);
}

}  // namespace nodal::host
