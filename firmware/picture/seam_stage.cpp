#include "firmware/picture/seam_stage.h"

#include "protocol/base/result.h"

namespace nodal::firmware {

bool SeamStage::step() {
  working_.store(true, std::memory_order_release);
  const auto request = requests_.pop();
  if (request) {
    const bool pushed = answers_.push(sets::place_seams(*request->plan, *request->views));
    NODAL_ASSERT(pushed);
  }
  working_.store(false, std::memory_order_release);
  return request.has_value();
}

}  // namespace nodal::firmware
