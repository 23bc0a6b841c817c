// All commands of `nodal`.
#pragma once

#include <CLI/App.hpp>

namespace nodal::host {

class CommandLine;

/// Adds every command below, in the order of `nodal --help`.
void add_all_commands(CLI::App& app, CommandLine& line);

// One function per file; each adds its command below `app` and registers its action.
void add_rigs(CLI::App& app, CommandLine& line);
void add_status(CLI::App& app, CommandLine& line);
void add_heads(CLI::App& app, CommandLine& line);
void add_hosts(CLI::App& app, CommandLine& line);
void add_exposure(CLI::App& app, CommandLine& line);
void add_genlock(CLI::App& app, CommandLine& line);
void add_calibration(CLI::App& app, CommandLine& line);
void add_take(CLI::App& app, CommandLine& line);
void add_offload(CLI::App& app, CommandLine& line);
void add_disk(CLI::App& app, CommandLine& line);
void add_audit(CLI::App& app, CommandLine& line);
void add_sync(CLI::App& app, CommandLine& line);
void add_raymap(CLI::App& app, CommandLine& line);
void add_import(CLI::App& app, CommandLine& line);
void add_pairs(CLI::App& app, CommandLine& line);
void add_drift(CLI::App& app, CommandLine& line);
void add_register(CLI::App& app, CommandLine& line);
void add_stitch(CLI::App& app, CommandLine& line);
void add_render(CLI::App& app, CommandLine& line);
void add_convert(CLI::App& app, CommandLine& line);
void add_view(CLI::App& app, CommandLine& line);
void add_look(CLI::App& app, CommandLine& line);
void add_web(CLI::App& app, CommandLine& line);
void add_mesh(CLI::App& app, CommandLine& line);
void add_export(CLI::App& app, CommandLine& line);
void add_pattern(CLI::App& app, CommandLine& line);
void add_calibrate(CLI::App& app, CommandLine& line);
/// `heads latency`, below `heads`.
void add_latency(CLI::App& heads, CommandLine& line);
/// `calibration join`, below `calibration`.
void add_calibration_join(CLI::App& group, CommandLine& line);
/// `calibration diff`, below `calibration`.
void add_calibration_diff(CLI::App& group, CommandLine& line);
/// `calibrate light`, below `calibrate`.
void add_calibrate_light(CLI::App& group, CommandLine& line);
/// `take verify`, below `take`.
void add_take_export(CLI::App& group, CommandLine& line);
void add_take_show(CLI::App& group, CommandLine& line);
void add_take_verify(CLI::App& group, CommandLine& line);
void add_completion(CLI::App& app, CommandLine& line);

}  // namespace nodal::host
