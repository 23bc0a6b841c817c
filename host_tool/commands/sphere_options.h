// The options --up and --split of commands that find or use a rig's calibration.
#pragma once

#include <string>

#include "host_tool/commands/command.h"
#include "host_tool/input/picture_split.h"
#include "host_tool/input/up_choice.h"

namespace nodal::host {

inline void add_up_option(CLI::App& command, std::string& up) {
  command
      .add_option(
          "--up", up,
          "Which way is up: auto (when not given), as the calibration has it or as it is found in the pictures;\n"
          "pictures, as most of them are held; or the direction that is up in the result of auto, degrees to\n"
          "the right of its middle and above it")
      ->type_name("auto|pictures|YAW,PITCH")
      ->check(checked_by(parse_up));
}

inline void add_split_option(CLI::App& command, std::string& split) {
  command
      .add_option(
          "--split", split,
          "Files that hold several pictures each, beside and below each other. auto (when not given): a single\n"
          "file with two circles, as 360-degree cameras write it, is two pictures; none: never")
      ->type_name("auto|none|COLUMNSxROWS")
      ->check(checked_by(parse_split));
}

}  // namespace nodal::host
