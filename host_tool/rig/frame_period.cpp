#include "host_tool/rig/frame_period.h"

#include "protocol/base/try.h"

namespace nodal::host {

Result<Duration> frame_period(RigConnection& rig) {
  wire::Request request;
  request.mutable_genlock();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  const auto rate = FrameRate::make(reply.genlock().rate_numerator(), reply.genlock().rate_denominator());
  if (!rate) return fail(Errc::kBadFormat, "the rig sent an invalid frame rate");
  return rate->period();
}

Result<Duration> patience_for_sets(RigConnection& rig) {
  constexpr int kPeriods = 10;
  NODAL_TRY_ASSIGN(const Duration period, frame_period(rig));
  return rig.patience() + period * kPeriods;
}

}  // namespace nodal::host
