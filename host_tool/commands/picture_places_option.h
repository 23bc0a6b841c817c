// The option --pictures-anywhere of commands that read projects.
#pragma once

#include <CLI/CLI.hpp>

#include "host_tool/input/project_pictures.h"

namespace nodal::host {

inline void add_picture_places(CLI::App& command, PicturePlaces& places) {
  command.add_flag_callback(
      kPicturesAnywhere, [&places] { places = PicturePlaces::kAnywhere; },
      "A project may name pictures outside its own folder");
}

}  // namespace nodal::host
