// What `nodal register` prints: a table for people, a document for scripts.
#pragma once

#include <string>

#include "host_tool/console/console.h"
#include "host_tool/report/verdict.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// Heads, pairs, steps and warnings. Unknown numbers are null.
Json register_json(const registration::Report& report);

struct Registered {
  bool alone = false;   ///< whether lens and directions were found in the pictures, and nothing was known of them
  bool focals = false;  ///< whether focal lengths were estimated, from known ones
  std::string out;      ///< the file of the calibration
  double seconds = 0;
};
void print_registration(Console& console, const registration::Report& report, const Verdict& verdict,
                        const Registered& registered);

}  // namespace nodal::host
