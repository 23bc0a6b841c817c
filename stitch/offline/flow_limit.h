// How far an optical flow may move pictures: not so far that one of them folds.
#pragma once

#include "stitch/offline/field.h"

namespace nodal::offline {

/// Shortens the flow (fx, fy) of flow_between() where moving the pictures by it would fold one of them, or nearly: the
/// two pictures then show different things, or the same thing so far apart that their overlap is too narrow for the
/// move. Around such a place the longest flow grows with the distance from it, so that straight edges stay nearly
/// straight.
///
/// known_a, known_b: 1 where a picture shows something; what is beyond does not count.
void limit_flow(const Field& known_a, const Field& known_b, const Field& share, Field& fx, Field& fy);

}  // namespace nodal::offline
