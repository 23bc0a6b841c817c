#include "stitch/sets/rig_heads.h"

#include <fmt/format.h>

#include <algorithm>

namespace nodal::sets {
namespace {

std::string size_of(int width, int height) { return fmt::format("{}x{}", width, height); }

}  // namespace

Result<Calibration> calibration_of(const Calibration& calibration, std::span<const RigHead> rig,
                                   const std::string& listed_in) {
  Calibration fitted = calibration;
  fitted.heads.clear();
  for (const RigHead& ours : rig) {
    const auto found = std::ranges::find(calibration.heads, ours.name, &HeadCalibration::name);
    if (found == calibration.heads.end()) {
      return fail(Errc::kHeadMismatch, "the rig's head '" + ours.name + "' is not in the calibration '" +
                                           calibration.name + "'; calibrate it, or rename it in " + listed_in);
    }
    if (ours.size && (ours.size->width != found->width || ours.size->height != found->height)) {
      return fail(Errc::kHeadMismatch, "head '" + found->name + "' delivers " +
                                           size_of(ours.size->width, ours.size->height) +
                                           ", but its calibration is for " + size_of(found->width, found->height));
    }
    fitted.heads.push_back(*found);
  }
  for (const HeadCalibration& head : calibration.heads) {
    if (std::ranges::find(rig, head.name, &RigHead::name) == rig.end()) {
      return fail(Errc::kHeadMismatch, "the calibration's head '" + head.name + "' is not in " + listed_in);
    }
  }
  return fitted;
}

}  // namespace nodal::sets
