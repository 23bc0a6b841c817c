#include "host_tool/input/registration_advice.h"

#include <string>

namespace nodal::host {

Error with_advice(Error error, bool nominal) {
  std::string options;
  const auto add = [&](const std::string& option) { options += (options.empty() ? "" : "; ") + option; };
  const std::string pairs = "--pairs FILE, if heads are far from where the calibration has them";
  if (error.code == Errc::kNoCoverage) {
    add("--free light, if the rotations are right and only gains and fall-off are wanted");
    add(pairs);
  } else if (error.code == Errc::kHeadMismatch) {
    add(pairs);
    add("--free focals, if the lenses were zoomed or focused, or --free lens, if they are other lenses");
  } else {
    return error;
  }
  if (nominal) {
    if (error.code == Errc::kHeadMismatch) {
      add("--lens FAMILY, if the data sheet names another kind than equidistant, such as equisolid or stereographic");
    }
    add("--circle X,Y,R, if the picture circles were not found correctly, as in dark pictures");
    add("--roll DEGREES, if the heads are mounted turned, such as 90 for upright pictures");
  }
  error.message += ". Options of `nodal register` that may help: " + options;
  return error;
}

}  // namespace nodal::host
