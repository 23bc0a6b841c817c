#include "host_tool/rig/frame_period.h"

namespace nodal::host {

Result<Duration> frame_period(RigConnection& rig) {
  wire::Request request;
  request.mutable_genlock();
  const Result<wire::Reply> reply = rig.ask(request);
  if (!reply) return fail(reply.error());
  const auto rate = FrameRate::make(reply->genlock().rate_numerator(), reply->genlock().rate_denominator());
  if (!rate) return fail(Errc::kBadFormat, "the rig sent an invalid frame rate");
  return rate->period();
}

Result<Duration> patience_for_sets(RigConnection& rig) {
  constexpr int kPeriods = 10;
  const Result<Duration> period = frame_period(rig);
  if (!period) return fail(period.error());
  return rig.patience() + *period * kPeriods;
}

}  // namespace nodal::host
