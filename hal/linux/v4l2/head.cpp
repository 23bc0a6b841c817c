#include "hal/linux/v4l2/head.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "hal/linux/v4l2/timestamps.h"

namespace nodal::hal::v4l2 {
namespace {

/// How often the input is asked for its signal state.
constexpr Duration kSignalEvery = Duration::milliseconds(500);

void report(Channel& channel, Channel::Report&& report) {
  const std::lock_guard lock(channel.mutex);
  channel.reports.push_back(std::move(report));
  if (channel.reported >= 0) ::eventfd_write(channel.reported, 1);
}

/// Applies the newest requested settings, and reads back the device's values.
void carry_out_controls(Channel& channel, ClockPort& clock) {
  ControlChange change;
  {
    const std::lock_guard lock(channel.mutex);
    change = std::exchange(channel.wanted, {});
    channel.controls_posted = false;
  }
  const Status set = channel.controls.set(*channel.device, change);
  const auto now = channel.controls.read(*channel.device);
  Channel::Report done{Channel::Report::About::kControls, 0, clock.now(), std::nullopt, {}, false};
  if (now) {
    done.settings = *now;
  } else {
    done.error = now.error();
  }
  if (!set) done.error = set.error();
  report(channel, std::move(done));
}

}  // namespace

V4l2Head::V4l2Head(std::string path, std::shared_ptr<Channel> channel, Worker& worker, ClockPort& clock,
                   std::shared_ptr<bool> in_use)
    : identity_{std::move(path), "", channel->device->card()},
      channel_(std::move(channel)),
      worker_(worker),
      clock_(clock),
      in_use_(std::move(in_use)),
      settings_(channel_->settings) {
  *in_use_ = true;
  const Granted& granted = channel_->granted;
  if (granted.storage != FieldStorage::kTogether) weaver_.emplace(granted.format, channel_->request.buffers);
}

V4l2Head::~V4l2Head() {
  if (state_ != State::kFailed) *in_use_ = false;  // a failed head has released it; another may hold it
  worker_.post([channel = std::move(channel_)] { channel->stream.end(); });
}

Error V4l2Head::error(Errc code, const std::string& sentence) const {
  return {code, "head '" + identity_.path + "': " + sentence};
}

Status V4l2Head::bad_value(const std::string& what, const std::string& allowed) const {
  return fail(error(Errc::kBadValue, what + " is outside " + allowed));
}

void V4l2Head::fail_for_good(Error why) {
  state_ = State::kFailed;
  final_ = std::move(why);
  *in_use_ = false;
}

Status V4l2Head::start(TriggerMode trigger) {
  if (state_ == State::kFailed) return fail(*final_);
  if (state_ != State::kStopped) return fail(error(Errc::kWrongState, "is started already; stop it first"));
  if (trigger == TriggerMode::kExternal) {
    return fail(error(Errc::kUnsupported,
                      "V4L2 has no trigger input; if the trigger's line is wired to the device, set trigger_mode = "
                      "\"wired\" in its entry of rig.toml"));
  }
  restarts_in_row_ = 0;
  post_stream(false);
  return {};
}

void V4l2Head::post_stream(bool again) {
  state_ = State::kStarting;
  std::vector<BufferSlot> to_queue;
  if (again) {
    for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
      if (slots_[slot] == Slot::kLent) continue;
      slots_[slot] = Slot::kQueued;
      to_queue.push_back(static_cast<BufferSlot>(slot));
    }
  }
  worker_.post([channel = channel_, &clock = clock_, start = ++starts_, again, to_queue = std::move(to_queue)] {
    const Status done = again ? channel->stream.restart(to_queue) : channel->stream.begin(channel->request.buffers);
    Channel::Report result{Channel::Report::About::kStream, start, clock.now(), std::nullopt, {}, false};
    if (!done) result.error = done.error();
    report(*channel, std::move(result));
  });
}

void V4l2Head::stop() {
  if (state_ == State::kStopped || state_ == State::kFailed) return;
  state_ = State::kStopped;
  ++starts_;  // discards the report of a start that is still in progress
  slots_.clear();
  first_field_.reset();
  if (weaver_) weaver_->take_back();
  worker_.post([channel = channel_] { channel->stream.end(); });
}

void V4l2Head::post_controls(const ControlChange& change) {
  {
    const std::lock_guard lock(channel_->mutex);
    channel_->wanted.add(change);
    if (std::exchange(channel_->controls_posted, true)) return;
  }
  worker_.post([channel = channel_, &clock = clock_] { carry_out_controls(*channel, clock); });
}

Status V4l2Head::set_exposure(Exposure exposure) {
  if (state_ == State::kFailed) return fail(*final_);
  const HeadLimits& can = limits();
  if (exposure < can.exposure_min || exposure > can.exposure_max) {
    return bad_value("an exposure of " + std::to_string(exposure.us()) + " us",
                     std::to_string(can.exposure_min.us()) + " to " + std::to_string(can.exposure_max.us()) + " us");
  }
  post_controls({exposure, {}, {}});
  return {};
}

Status V4l2Head::set_gain(Gain gain) {
  if (state_ == State::kFailed) return fail(*final_);
  const HeadLimits& can = limits();
  if (gain < can.gain_min || gain > can.gain_max) {
    return bad_value("a gain of " + std::to_string(gain.mdb()) + " mdB",
                     std::to_string(can.gain_min.mdb()) + " to " + std::to_string(can.gain_max.mdb()) + " mdB");
  }
  post_controls({{}, gain, {}});
  return {};
}

Status V4l2Head::set_white_balance(WhiteBalance balance) {
  if (state_ == State::kFailed) return fail(*final_);
  if (!limits().has_white_balance) return fail(error(Errc::kUnsupported, "has no white balance to set"));
  post_controls({{}, {}, balance});
  return {};
}

Status V4l2Head::set_gamma(Gamma gamma) {
  if (state_ == State::kFailed) return fail(*final_);
  if (gamma == settings_.gamma) return {};
  return fail(error(Errc::kUnsupported, "has no gamma to set"));
}

Status V4l2Head::nudge(Duration) { return fail(error(Errc::kUnsupported, "its frames cannot be moved in time")); }

void V4l2Head::take_reports() {
  std::vector<Channel::Report> reports;
  {
    const std::lock_guard lock(channel_->mutex);
    eventfd_t counted = 0;
    if (!channel_->reports.empty() && channel_->reported >= 0) ::eventfd_read(channel_->reported, &counted);
    reports.swap(channel_->reports);
  }
  for (Channel::Report& each : reports) {
    if (state_ == State::kFailed) return;
    switch (each.about) {
      case Channel::Report::About::kSignal:
        signal_asked_ = false;
        no_signal_ = each.no_signal;
        break;
      case Channel::Report::About::kControls: take_settings(each); break;
      case Channel::Report::About::kStream:
        if (each.start != starts_ || state_ != State::kStarting) break;
        if (each.error) {
          fail_for_good(std::move(*each.error));
          break;
        }
        state_ = State::kStreaming;
        started_ = each.at;
        if (slots_.empty()) slots_.assign(channel_->stream.buffers(), Slot::kQueued);
        break;
    }
  }
}

void V4l2Head::take_settings(const Channel::Report& report) {
  if (report.error) {
    if (report.error->code == Errc::kDeviceGone) fail_for_good(*report.error);
    return;  // the device's settings are unknown: keep the last known ones
  }
  pending_.push_back({report.at, report.settings, limits().control_latency_frames});
}

void V4l2Head::queue_idle() {
  for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
    if (slots_[slot] != Slot::kIdle) continue;
    if (channel_->stream.queue(static_cast<BufferSlot>(slot)) != 0) return restart();
    slots_[slot] = Slot::kQueued;
  }
}

void V4l2Head::restart() {
  if (restarts_in_row_ == kMostRestarts) {
    return fail_for_good(error(Errc::kDeviceFailed, "its stream broke " + std::to_string(kMostRestarts) +
                                                        " times in a row; unplug it and plug it in again"));
  }
  first_field_.reset();
  if (weaver_) weaver_->drop_unfinished();
  ++restarts_in_row_;
  ++recoveries_.restarts;
  post_stream(true);
}

void V4l2Head::watch_signal(Instant now) {
  if (signal_asked_ || now < next_signal_) return;
  signal_asked_ = true;
  next_signal_ = now + kSignalEvery;
  worker_.post([channel = channel_] {
    const bool none = no_signal(*channel->device, channel->granted.input);
    report(*channel, {Channel::Report::About::kSignal, 0, {}, std::nullopt, {}, none});
  });
}

Result<std::optional<FrameView>> V4l2Head::take_frame() {
  if (state_ == State::kStopped) return fail(error(Errc::kWrongState, "take_frame() before start()"));
  take_reports();
  if (state_ == State::kStreaming) queue_idle();
  Stream::Frame frame;
  const Instant now = clock_.now();
  if (state_ == State::kStreaming) {
    watch_signal(now);
    int failed = channel_->stream.dequeue(frame);
    while (failed == 0) {
      restarts_in_row_ = 0;
      slots_[frame.slot] = Slot::kLent;
      if (!weaver_) return std::optional<FrameView>{view(frame, now)};
      if (auto whole = weave(frame, now)) return whole;
      failed = channel_->stream.dequeue(frame);
    }
    if (failed == ENODEV || failed == ENXIO) {
      fail_for_good(channel_->device->explained("taking a frame", failed));
    } else if (failed != EAGAIN) {
      restart();
    }
  }
  if (state_ == State::kFailed) return fail(*final_);
  return std::optional<FrameView>{};
}

/// Without descriptors for reports the caller looks for them at its own interval.
void V4l2Head::add_wake_ups(WakeUps& to) const {
  if (state_ == State::kStopped || state_ == State::kFailed) return;
  to.on({channel_->reported, true, false});
  if (state_ != State::kStreaming) return;  // poll() reports an error while the device does not stream
  if (!signal_asked_) to.at(next_signal_);
  to.on({channel_->device->fd(), true, false});
}

FrameView V4l2Head::stamped(const Stream::Frame& frame, Instant now) {
  const Granted& granted = channel_->granted;
  FrameView view;
  view.slot = frame.slot;
  view.sequence = frame.sequence;
  FrameTimes times = times_of(frame.flags, frame.timestamp, now, settings_.exposure, granted.readout);
  // A change applies to frames that begin after it, plus the control latency; to every frame of a stream that was
  // started after it.
  while (!pending_.empty()) {
    Pending& next = pending_.front();
    const Instant begin = times.mid_exposure - settings_.exposure.duration() / 2;
    if (next.at > started_ && begin < next.at) break;
    if (next.at > started_ && next.frames_left-- > 0) break;
    settings_ = next.settings;
    pending_.pop_front();
    times = times_of(frame.flags, frame.timestamp, now, settings_.exposure, granted.readout);
  }
  view.mid_exposure = times.mid_exposure;
  view.received = times.received;
  view.in_effect = settings_;
  view.verdict = frame.verdict;
  if (no_signal_ && view.verdict == FrameVerdict::kGood) view.verdict = FrameVerdict::kNoSignal;
  return view;
}

FrameView V4l2Head::view(const Stream::Frame& frame, Instant now) {
  FrameView view = stamped(frame, now);
  view.fields = fields_of(frame.field, channel_->granted.interlaced).value_or(Fields::kTopOnly);
  view.image = channel_->stream.picture(frame.slot);
  view.image.coding = channel_->granted.coding;
  return view;
}

/// Copies a buffer's fields and returns the buffer. Returns the frame that is finished by it, if any.
std::optional<FrameView> V4l2Head::weave(const Stream::Frame& frame, Instant now) {
  const Granted& granted = channel_->granted;
  ImageView picture = channel_->stream.picture(frame.slot);
  std::optional<FieldWeaver::Frame> done;
  Stream::Frame first = frame;
  if (granted.storage == FieldStorage::kSequential) {
    const FieldParity order = frame.field == V4L2_FIELD_SEQ_BT ? FieldParity::kBottom : FieldParity::kTop;
    for (const FieldParity parity : {order, other(order)}) {
      ImageView field = picture;
      field.height /= 2;
      for (PlaneView& plane : field.planes) {
        plane.height /= 2;
        if (parity != order && plane.data != nullptr) plane.data += plane.height * plane.row_stride;
      }
      done = weaver_->put({parity, frame.sequence, field});
    }
  } else {
    const FieldParity parity = frame.field == V4L2_FIELD_BOTTOM ? FieldParity::kBottom : FieldParity::kTop;
    done = weaver_->put({parity, frame.sequence, picture});
    if (done) first = first_field_.value_or(frame);
    const bool whole = done && (done->fields == Fields::kTopFirst || done->fields == Fields::kBottomFirst);
    first_field_ = whole ? std::nullopt : std::optional(frame);
    if (whole && first.verdict == FrameVerdict::kGood) first.verdict = frame.verdict;
  }
  release_to_driver(frame.slot);
  if (!done) return std::nullopt;
  FrameView view = stamped(first, now);
  view.received = now;
  view.slot = done->slot;
  view.fields = done->fields;
  view.image = done->image;
  view.image.coding = granted.coding;
  return view;
}

void V4l2Head::release(BufferSlot slot) {
  if (weaver_) {
    weaver_->release(slot);
  } else {
    release_to_driver(slot);
  }
}

void V4l2Head::release_to_driver(BufferSlot slot) {
  if (slot >= slots_.size() || slots_[slot] != Slot::kLent) return;
  slots_[slot] = Slot::kIdle;
  if (state_ != State::kStreaming) return;  // queued when the stream runs again
  if (channel_->stream.queue(slot) == 0) {
    slots_[slot] = Slot::kQueued;
  } else {
    ++recoveries_.refused_buffers;  // take_frame() tries again
  }
}

}  // namespace nodal::hal::v4l2
