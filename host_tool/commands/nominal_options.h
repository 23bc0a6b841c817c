// The options that describe a rig by its data sheet, for every command that starts from one.
#pragma once

#include <CLI/App.hpp>

#include "host_tool/commands/command.h"
#include "host_tool/input/nominal_rig.h"

namespace nodal::host {

/// --nominal, --circle, --at, --lens and --roll. `words` must live as long as the command.
inline void add_nominal_options(CLI::App& command, NominalWords& words) {
  CLI::Option* const nominal =
      command
          .add_option("--nominal", words.rig,
                      "Start from the data sheet: number of heads x field of view, such as 2x190")
          ->type_name("NxDEGREES")
          ->check(checked_by(parse_nominal));
  command
      .add_option("--circle", words.circles,
                  "Circle of a fisheye's picture, px: once for all heads, or once for each; found in the pictures when "
                  "not given")
      ->type_name("X,Y,RADIUS")
      ->needs(nominal)
      ->allow_extra_args(false)
      ->check(checked_by(parse_circle));
  command
      .add_option(
          "--at", words.places,
          "Where a head looks: degrees right, degrees up, and its roll; once for each head; evenly around the horizon\n"
          "when not given")
      ->type_name("YAW,PITCH[,ROLL]")
      ->needs(nominal)
      ->allow_extra_args(false)
      ->check(checked_by(parse_place));
  command.add_option("--lens", words.lens, "Their lenses (fisheye, which is equidistant, when not given)")
      ->type_name("fisheye|equidistant|equisolid|stereographic|orthographic|rectilinear")
      ->needs(nominal)
      ->check(checked_by(parse_nominal_lens));
  command.add_option("--roll", words.roll_deg, "Their roll, degrees clockwise")->type_name("DEGREES")->needs(nominal);
}

}  // namespace nodal::host
