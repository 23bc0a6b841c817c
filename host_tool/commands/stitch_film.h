// `nodal stitch` with films: one film of the whole sphere from a film of each head.
#pragma once

#include <string>
#include <vector>

#include "host_tool/commands/command.h"
#include "host_tool/commands/film_work.h"
#include "host_tool/commands/stitch_job.h"

namespace nodal::host {

struct FilmArgs {
  CodingArgs coding;
  std::vector<std::string> offsets;
  std::string times = "auto";
  double readout_ms = 0;
  std::string sound = "auto";
  std::string seams = "placed";
  std::string light = "matched";
  int rate = 30;  ///< pictures a second, of folders with pictures
  PartsArgs parts;
};

/// Those of film_work.h, and --offset, --times, --readout, --sound, --seams, --light, --rate.
void add_film_options(CLI::App& command, FilmArgs& args);

/// Whether a result of this name is a film.
bool makes_film(const std::string& out);

Status run_film(Context& context, const StitchArgs& args, const FilmArgs& film);

}  // namespace nodal::host
