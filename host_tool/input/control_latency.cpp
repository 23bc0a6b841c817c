#include "host_tool/input/control_latency.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tool/console/quantities.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/rig/frame_period.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

constexpr int kSettleFrames = 12;  ///< until the brightness is measured
/// Closer to a frame's begin than this part of a period, and than this time, a request may be before or after it. The
/// time is what timestamps and the way of a request are off by; at a low rate a tenth of a period would be most of the
/// time after a set.
constexpr double kAmbiguous = 0.1;
constexpr double kAmbiguousNs = 3e6;
constexpr int kSettleTries = 200;  ///< frame sets; a head may miss some

/// Which frame after the request it is, or nothing if timestamps are too uncertain to tell. Negative: before.
std::optional<int> frame_after(double begin_ns, double request_ns, double period_ns) {
  const double frames = (begin_ns - request_ns) / period_ns;
  const double whole = std::floor(frames);
  const double ambiguous = std::min(kAmbiguous, kAmbiguousNs / period_ns);
  if (std::abs(frames) > 1e6 || frames - whole < ambiguous || frames - whole > 1 - ambiguous) return std::nullopt;
  return static_cast<int>(whole);
}

class Measurement {
 public:
  Measurement(RigConnection& rig, const wire::HeadState& head) : rig_(rig), head_(head) {}

  Status prepare() {
    NODAL_TRY_ASSIGN(const Duration period, frame_period(rig_));
    period_ns_ = static_cast<double>(period.ns());
    NODAL_TRY_ASSIGN(const Duration within, patience_for_sets(rig_));
    within_ = within;
    result_.exposure_ns = head_.exposure_ns();
    const std::uint64_t half = head_.exposure_ns() / 2;
    const std::uint64_t twice = 2 * head_.exposure_ns();
    const bool can_double = twice <= head_.exposure_max_ns() && static_cast<double>(twice) < 0.9 * period_ns_;
    if (half >= std::max<std::uint64_t>(head_.exposure_min_ns(), 1000)) result_.stepped_ns = half;
    else if (head_.exposure_ns() > 0 && can_double) result_.stepped_ns = twice;
    else {
      return fail(Errc::kUnsupported,
                  fmt::format("head '{}': its exposure of {} can be neither halved nor doubled; its "
                              "range is {} to {}",
                              head_.name(), show_exposure(head_.exposure_ns()), show_exposure(head_.exposure_min_ns()),
                              show_exposure(head_.exposure_max_ns())));
    }
    return {};
  }

  Result<ControlLatency> run(const std::function<void(int)>& progress) {
    NODAL_TRY_ASSIGN(const double before, settled(result_.exposure_ns));
    NODAL_TRY_ASSIGN(const double after, settled(result_.stepped_ns));
    result_.brightness = before;
    result_.stepped_brightness = after;
    if (std::abs(before - after) < kMinLevels) {
      return fail(
          Errc::kWrongState,
          fmt::format("head '{}': its picture has a brightness of {:.1f} of 255 with {}, and {:.1f} with {}; with "
                      "more light, or less if it is overexposed, the difference is visible",
                      head_.name(), before, show_exposure(result_.exposure_ns), after,
                      show_exposure(result_.stepped_ns)));
    }
    bool stepped = true;
    for (result_.steps = 1; result_.steps <= kLatencySteps; ++result_.steps) {
      stepped = !stepped;
      NODAL_TRY(step(stepped, result_.steps % 3));
      progress(result_.steps);
      if (result_.steps >= kFewestLatencySteps && result_.seen.exact() && result_.stated.exact()) break;
    }
    result_.steps = std::min(result_.steps, kLatencySteps);
    if (result_.seen.high() == INT_MAX) return no_frames();  // every request was too close to a frame's begin
    return result_;
  }

  /// The rig restores the head's exposure, as it does by itself when this program ends in any way.
  Status restore() {
    wire::Request request;
    request.mutable_head_set()->set_temporary(true);
    const Result<wire::Reply> reply = rig_.ask(request);
    return reply ? Status() : fail(reply.error());
  }

 private:
  /// Returns when the head got the exposure, which it has only temporarily.
  Result<double> set(std::uint64_t exposure_ns) {
    wire::Request request;
    request.mutable_head_set()->add_heads(head_.index());
    request.mutable_head_set()->set_exposure_ns(exposure_ns);
    request.mutable_head_set()->set_temporary(true);
    NODAL_TRY_ASSIGN(const wire::Reply reply, rig_.ask(request));
    if (reply.done().at_ns() == 0) {
      return fail(Errc::kUnsupported, fmt::format("{} at {} does not say when a head got its settings; update nodald",
                                                  rig_.rig().software(), rig_.address()));
    }
    return static_cast<double>(reply.done().at_ns());
  }

  double begin_of(const HeadSample& sample) const {
    return static_cast<double>(sample.mid_exposure_ns) + static_cast<double>(head_.skew_ns()) -
           static_cast<double>(sample.exposure_ns) / 2;
  }

  /// The brightness some frames after the exposure was set.
  Result<double> settled(std::uint64_t exposure_ns) {
    NODAL_TRY_ASSIGN(const double at, set(exposure_ns));
    for (int i = 0; i < kSettleTries; ++i) {
      NODAL_TRY_ASSIGN(const std::optional<HeadSample> sample, sample_head(rig_, head_.index(), within_));
      if (sample && begin_of(*sample) > at + kSettleFrames * period_ns_) return sample->brightness;
    }
    return no_frames();
  }

  tl::unexpected<Error> no_frames() const {
    return fail(Errc::kTimeout,
                fmt::format("head '{}': no frames come after the change; `nodal heads` says why", head_.name()));
  }

  /// One change, to the stepped exposure or back. Frames are sampled from `later` periods after it on, so that all
  /// frames are sampled in some step, also over a link that carries every third frame set.
  Status step(bool stepped, int later) {
    NODAL_TRY_ASSIGN(const double at, set(stepped ? result_.stepped_ns : result_.exposure_ns));
    if (later > 0) {
      NODAL_TRY(rig_.rest(Duration::nanoseconds(std::llround(later * period_ns_))));
    }
    const double middle = (result_.brightness + result_.stepped_brightness) / 2;
    const bool dark_is_new = stepped == (result_.stepped_brightness < result_.brightness);
    const double middle_ns =
        std::sqrt(static_cast<double>(result_.exposure_ns) * static_cast<double>(result_.stepped_ns));
    const bool short_is_new = stepped == (result_.stepped_ns < result_.exposure_ns);
    for (int i = 0; i < kSettleTries; ++i) {
      NODAL_TRY_ASSIGN(const std::optional<HeadSample> sample, sample_head(rig_, head_.index(), within_));
      if (!sample) continue;
      if (begin_of(*sample) < at) continue;
      const auto frame = frame_after(begin_of(*sample), at, period_ns_);
      if (!frame) return {};  // this request was too close to a frame's begin; the next step has another phase
      const bool seen = (sample->brightness < middle) == dark_is_new;
      const bool stated = (static_cast<double>(sample->exposure_ns) < middle_ns) == short_is_new;
      if (seen) result_.seen.has_new(*frame);
      else result_.seen.has_old(*frame);
      if (stated) result_.stated.has_new(*frame);
      else result_.stated.has_old(*frame);
      if (seen && stated) return {};
      if (*frame > kLongestLatency) {
        return fail(Errc::kTimeout,
                    fmt::format("head '{}': its picture does not change within {} frames after its exposure "
                                "is changed",
                                head_.name(), kLongestLatency));
      }
    }
    return no_frames();
  }

  RigConnection& rig_;
  const wire::HeadState& head_;
  double period_ns_ = 0;
  Duration within_;  ///< longest wait for a frame set
  ControlLatency result_;
};

}  // namespace

Result<ControlLatency> measure_control_latency(RigConnection& rig, const wire::HeadState& head,
                                               const std::function<void(int)>& progress) {
  Measurement measurement(rig, head);
  NODAL_TRY(measurement.prepare());
  NODAL_TRY_ASSIGN(ControlLatency measured, measurement.run(progress));
  NODAL_TRY(measurement.restore());
  return measured;
}

}  // namespace nodal::host
