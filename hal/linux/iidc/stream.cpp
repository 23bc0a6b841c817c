#include "hal/linux/iidc/stream.h"

#include "protocol/base/try.h"

namespace nodal::hal::iidc {

Status Stream::begin(int buffers, const std::optional<TriggerChoice>& trigger) {
  end();
  NODAL_TRY(camera_.transmit(false));
  NODAL_TRY(camera_.set_trigger(trigger));
  NODAL_TRY_ASSIGN(auto source, camera_.make_source(buffers, granted_.frame_bytes));
  source_ = std::move(source);
  Status begun = transfer();
  if (!begun) end();
  return begun;
}

Status Stream::transfer() {
  if (const int error = source_->begin(); error != 0) return fail(camera_.explained("starting its stream", error));
  return camera_.transmit(true);
}

Status Stream::restart() {
  Status quiet = camera_.transmit(false);
  source_->end();
  if (!quiet) return quiet;
  return transfer();
}

void Stream::end() {
  if (!source_) return;
  (void)camera_.transmit(false);  // a camera that is gone does not transmit
  source_.reset();
}

}  // namespace nodal::hal::iidc
