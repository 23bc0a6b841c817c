// Where a result's lenses are known, if overlaps show too little of them.
#pragma once

#include <string>

#include "protocol/base/result.h"
#include "stitch/registration/registration.h"
#include "stitch/registration/seen_radii.h"

namespace nodal::registration {

/// Of a calibration whose overlaps determine no whole lenses. Where the kind of lens is an assumption, lenses of any
/// kind that have the same radius at one angle fit the pictures nearly as well: at the middle of what overlaps show if
/// focal lengths were estimated, at the edge of the picture if the data sheet's field of view holds them.
/// Errors: those of geometry::Lens::make().
Result<KnownLens> known_lens(const Calibration& result, const SeenRadii& seen, const Options& asked, Free estimated);

/// The calibration's comment with a sentence that says it, in place of an earlier one.
std::string commented(const std::string& comment, const KnownLens& known);

}  // namespace nodal::registration
