// Where a lens is known, in the --json of commands that estimate one.
#pragma once

#include <cmath>

#include "host_tool/console/console.h"
#include "host_tool/input/rig_pictures.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// A lens found by points.
inline Json lens_json(const FoundLens& lens) {
  return {{"seen_px", {lens.seen.from_px, lens.seen.to_px}},
          {"seen_deg", {lens.seen.from_deg, lens.seen.to_deg}},
          {"known_px", {lens.known.from_px, lens.known.to_px}},
          {"known_deg", {lens.known.from_deg, lens.known.to_deg}},
          {"known_everywhere", lens.whole},
          {"assumed_elsewhere", lens.family},
          {"may_be_wrong_elsewhere_percent", lens.whole ? 0 : lens.may_be_wrong_percent()}};
}

/// Lenses of which overlaps show too little. 0 percent: elsewhere they are those that the registration started from.
inline Json lens_json(const registration::KnownLens& lens) {
  return {{"known_px", {lens.from_px, lens.to_px}},
          {"known_deg", {lens.from_deg, lens.to_deg}},
          {"known_everywhere", false},
          {"may_be_wrong_elsewhere_percent", std::ceil(100 * lens.unsure)}};
}

}  // namespace nodal::host
