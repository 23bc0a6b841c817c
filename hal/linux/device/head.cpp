#include "hal/linux/device/head.h"

#include <fmt/format.h>

#include <utility>

#include "protocol/base/try.h"

namespace nodal::hal::device {
namespace {

/// Applies the newest requested settings, and reads back the device's values.
void carry_out_controls(Channel& channel, ClockPort& clock) {
  ControlChange change;
  {
    const std::lock_guard lock(channel.mutex);
    change = std::exchange(channel.wanted, {});
    channel.controls_posted = false;
  }
  const Status set = channel.set(change);
  const auto now = channel.read();
  Channel::Report done{Channel::Report::About::kControls, 0, clock.now(), std::nullopt, {}};
  if (now) {
    done.settings = *now;
  } else {
    done.error = now.error();
  }
  if (!set) done.error = set.error();
  channel.report(std::move(done));
}

}  // namespace

DeviceHead::DeviceHead(HeadIdentity identity, std::shared_ptr<Channel> channel, Worker& worker, ClockPort& clock,
                       std::shared_ptr<bool> in_use)
    : identity_(std::move(identity)),
      channel_(std::move(channel)),
      worker_(worker),
      clock_(clock),
      in_use_(std::move(in_use)),
      settings_(channel_->settings()) {
  *in_use_ = true;
}

DeviceHead::~DeviceHead() {
  if (state_ != State::kFailed) *in_use_ = false;  // a failed head has released it; another may hold it
  worker_.post([channel = std::move(channel_)] { channel->end(); });
}

Error DeviceHead::error(Errc code, const std::string& sentence) const {
  return {code, "head '" + identity_.path + "': " + sentence};
}

Status DeviceHead::bad_value(const std::string& what, const std::string& allowed) const {
  return fail(error(Errc::kBadValue, what + " is not possible; allowed are " + allowed));
}

void DeviceHead::fail_for_good(Error why) {
  state_ = State::kFailed;
  final_ = std::move(why);
  *in_use_ = false;
}

Status DeviceHead::start(TriggerMode trigger) {
  if (state_ == State::kFailed) return fail(*final_);
  if (state_ != State::kStopped) return fail(error(Errc::kWrongState, "is started already; stop it first"));
  NODAL_TRY_ASSIGN(auto job, begin(trigger));
  restarts_in_row_ = 0;
  post_stream(std::move(job));
  return {};
}

void DeviceHead::post_stream(StreamJob job) {
  state_ = State::kStarting;
  worker_.post([channel = channel_, &clock = clock_, start = ++starts_, job = std::move(job)] {
    const Status done = job();
    Channel::Report result{Channel::Report::About::kStream, start, clock.now(), std::nullopt, {}};
    if (!done) result.error = done.error();
    channel->report(std::move(result));
  });
}

void DeviceHead::stop() {
  if (state_ == State::kStopped || state_ == State::kFailed) return;
  state_ = State::kStopped;
  ++starts_;  // discards the report of a start that is still in progress
  stopped();
  worker_.post([channel = channel_] { channel->end(); });
}

void DeviceHead::restart(StreamJob job) {
  if (restarts_in_row_ == kMaxRestarts) {
    return fail_for_good(
        error(Errc::kDeviceFailed,
              fmt::format("its stream broke {} times in a row; unplug it and plug it in again", kMaxRestarts)));
  }
  ++restarts_in_row_;
  ++recoveries_.restarts;
  post_stream(std::move(job));
}

void DeviceHead::post_controls(const ControlChange& change) {
  {
    const std::lock_guard lock(channel_->mutex);
    channel_->wanted.add(change);
    if (std::exchange(channel_->controls_posted, true)) return;
  }
  worker_.post([channel = channel_, &clock = clock_] { carry_out_controls(*channel, clock); });
}

Status DeviceHead::set_exposure(Exposure exposure) {
  if (state_ == State::kFailed) return fail(*final_);
  const HeadLimits& can = limits();
  if (exposure < can.exposure_min || exposure > can.exposure_max) {
    return bad_value(fmt::format("an exposure of {} us", exposure.us()),
                     fmt::format("{} to {} us", can.exposure_min.us(), can.exposure_max.us()));
  }
  post_controls({exposure, {}, {}});
  return {};
}

Status DeviceHead::set_gain(Gain gain) {
  if (state_ == State::kFailed) return fail(*final_);
  const HeadLimits& can = limits();
  if (gain < can.gain_min || gain > can.gain_max) {
    return bad_value(fmt::format("a gain of {:g} dB", gain.mdb() / 1e3),
                     fmt::format("{:g} to {:g} dB", can.gain_min.mdb() / 1e3, can.gain_max.mdb() / 1e3));
  }
  post_controls({{}, gain, {}});
  return {};
}

Status DeviceHead::set_white_balance(WhiteBalance balance) {
  if (state_ == State::kFailed) return fail(*final_);
  if (!limits().has_white_balance) return fail(error(Errc::kUnsupported, "has no white balance to set"));
  post_controls({{}, {}, balance});
  return {};
}

Status DeviceHead::set_gamma(Gamma gamma) {
  if (state_ == State::kFailed) return fail(*final_);
  if (gamma == settings_.gamma) return {};
  return fail(error(Errc::kUnsupported, "has no gamma to set"));
}

Status DeviceHead::nudge(Duration) { return fail(error(Errc::kUnsupported, "its frames cannot be moved in time")); }

void DeviceHead::take_reports() {
  std::vector<Channel::Report> reports;
  {
    const std::lock_guard lock(channel_->mutex);
    eventfd_t counted = 0;
    if (!channel_->reports.empty() && channel_->reported >= 0) ::eventfd_read(channel_->reported, &counted);
    reports.swap(channel_->reports);
  }
  for (Channel::Report& each : reports) {
    if (state_ == State::kFailed) return;
    if (each.about == Channel::Report::About::kControls) {
      take_settings(each);
      continue;
    }
    if (each.start != starts_ || state_ != State::kStarting) continue;
    if (each.error) {
      fail_for_good(std::move(*each.error));
      continue;
    }
    state_ = State::kStreaming;
    started_ = each.at;
    on_stream_start();
  }
}

void DeviceHead::take_settings(const Channel::Report& report) {
  if (report.error) {
    if (report.error->code == Errc::kDeviceGone) fail_for_good(*report.error);
    return;  // the device's settings are unknown: keep the last known ones
  }
  pending_.push_back({report.at, report.settings, limits().control_latency_frames});
}

const HeadSettings& DeviceHead::settings_of(const std::function<Instant(Exposure)>& begin_with) {
  while (!pending_.empty()) {
    Pending& next = pending_.front();
    if (next.at > started_ && begin_with(settings_.exposure) < next.at) break;
    if (next.at > started_ && next.frames_left-- > 0) break;
    settings_ = next.settings;
    pending_.pop_front();
  }
  return settings_;
}

}  // namespace nodal::hal::device
