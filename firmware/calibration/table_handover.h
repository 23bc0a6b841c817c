// Gives tables to the blend, and takes the old ones back.
#pragma once

#include <utility>

#include "firmware/frame/drain.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"
#include "stitch/sets/blend_plan.h"

namespace nodal::firmware {

/// The blend takes a table between two sets.
///
/// Threading: thread-bound to the keeper; the rings' other ends are the blend's.
/// Ownership: shares the newest table with the blend.
/// Errors: none; give() while room() is false is asserted.
class TableHandover {
 public:
  TableHandover(SpscRing<sets::BlendSetup>& out, SpscRing<sets::BlendSetup>& back) : out_(out), back_(back) {}

  /// False while the blend has not taken the table before.
  bool room() const { return !out_.full(); }
  void give(sets::BlendSetup setup) {
    newest_ = setup;
    const bool pushed = out_.push(std::move(setup));
    NODAL_ASSERT(pushed);
  }
  /// The table that the blend uses, or takes next; empty before the first.
  const sets::BlendSetup& newest() const { return newest_; }
  /// Frees the tables that came back here, outside the frame path. True when there was one.
  bool free_old() {
    return drain(back_, [](auto) {});
  }

 private:
  SpscRing<sets::BlendSetup>& out_;
  SpscRing<sets::BlendSetup>& back_;
  sets::BlendSetup newest_;
};

}  // namespace nodal::firmware
