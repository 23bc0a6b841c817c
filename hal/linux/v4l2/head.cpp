#include "hal/linux/v4l2/head.h"

#include <linux/videodev2.h>

#include <cerrno>
#include <utility>

#include "hal/linux/v4l2/timestamps.h"

namespace nodal::hal::v4l2 {
namespace {

/// How often the input is asked for its signal state.
constexpr Duration kSignalEvery = Duration::milliseconds(500);
/// A thread that has no time to sleep asks the driver at every eighth call.
constexpr int kMaxSkipped = 8;

}  // namespace

bool Channel::gone() const {
  v4l2_capability capability{};
  return camera->ioctl(VIDIOC_QUERYCAP, &capability) == ENODEV;
}

V4l2Head::V4l2Head(std::string path, std::shared_ptr<Channel> channel, device::Worker& worker, ClockPort& clock,
                   std::shared_ptr<bool> in_use)
    : DeviceHead({std::move(path), "", channel->camera->card()}, channel, worker, clock, std::move(in_use)),
      channel_(std::move(channel)) {
  const Granted& granted = channel_->granted;
  if (granted.storage != FieldStorage::kTogether) weaver_.emplace(granted.format, channel_->request.buffers);
}

Result<device::DeviceHead::StreamJob> V4l2Head::begin(TriggerMode trigger) {
  if (trigger == TriggerMode::kExternal) {
    return fail(error(Errc::kUnsupported,
                      "V4L2 has no trigger input; if the trigger's line is wired to the device, set trigger_mode = "
                      "\"wired\" in its entry of rig.toml"));
  }
  return StreamJob([channel = channel_] { return channel->stream.begin(channel->request.buffers); });
}

void V4l2Head::on_stream_start() {
  if (slots_.empty()) slots_.assign(channel_->stream.buffers(), Slot::kQueued);
}

void V4l2Head::stopped() {
  slots_.clear();
  first_field_.reset();
  if (weaver_) weaver_->take_back();
}

void V4l2Head::queue_idle() {
  for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
    if (slots_[slot] != Slot::kIdle) continue;
    if (channel_->stream.queue(static_cast<BufferSlot>(slot)) != 0) return restart_stream();
    slots_[slot] = Slot::kQueued;
  }
}

void V4l2Head::restart_stream() {
  first_field_.reset();
  if (weaver_) weaver_->drop_unfinished();
  std::vector<BufferSlot> to_queue;
  for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
    if (slots_[slot] == Slot::kLent) continue;
    slots_[slot] = Slot::kQueued;
    to_queue.push_back(static_cast<BufferSlot>(slot));
  }
  restart([channel = channel_, to_queue = std::move(to_queue)] { return channel->stream.restart(to_queue); });
}

void V4l2Head::watch_signal(Instant now) {
  if (now < next_signal_) return;
  next_signal_ = now + kSignalEvery;
  if (channel_->signal_asked.exchange(true)) return;
  worker().post([channel = channel_] {
    channel->no_signal = no_signal(*channel->camera, channel->granted.input);
    channel->signal_asked = false;
  });
}

/// Asking costs a system call for each head and each step of the capture stage, and most steps are for other heads or
/// for buffers that come back.
bool V4l2Head::may_have_frame() {
  if (!ready_.value_or(true) && ++skipped_ < kMaxSkipped) return false;
  skipped_ = 0;
  return true;
}

Result<std::optional<FrameView>> V4l2Head::take_frame() {
  if (state() == State::kStopped) return fail(error(Errc::kWrongState, "take_frame() before start()"));
  take_reports();
  if (state() == State::kStreaming) queue_idle();
  while (state() == State::kStreaming && may_have_frame()) {
    Stream::Frame frame;
    const Instant now = clock().now();
    if (const int failed = channel_->stream.dequeue(frame); failed == EAGAIN) {
      break;
    } else if (failed == ENODEV || failed == ENXIO) {
      fail_for_good(channel_->camera->explained("taking a frame", failed));
    } else if (failed != 0) {
      restart_stream();
    } else {
      frame_is_good();
      watch_signal(now);
      slots_[frame.slot] = Slot::kLent;
      // Two fields are half a period apart, so none can have come since.
      if (ready_ && frame.timestamp + format().rate.period() / 4 > now) ready_ = false;
      if (!weaver_) return std::optional<FrameView>{view(frame, now)};
      if (auto whole = weave(frame, now)) return whole;
    }
  }
  if (state() == State::kFailed) return fail(why());
  return std::optional<FrameView>{};
}

void V4l2Head::add_wake_ups(WakeUps& to) const {
  if (state() == State::kStopped || state() == State::kFailed) return;
  add_report_wake_up(to);
  if (state() != State::kStreaming) return;  // poll() reports an error while the device does not stream
  ready_.reset();
  skipped_ = 0;
  to.on({channel_->camera->fd(), true, false, &ready_});
}

FrameView V4l2Head::stamped(const Stream::Frame& frame, Instant now) {
  const Granted& granted = channel_->granted;
  const auto times = [&](Exposure exposure) {
    return times_of(frame.flags, frame.timestamp, now, exposure, granted.readout);
  };
  FrameView view;
  view.slot = frame.slot;
  view.sequence = frame.sequence;
  view.in_effect =
      settings_of([&](Exposure exposure) { return times(exposure).mid_exposure - exposure.duration() / 2; });
  view.mid_exposure = times(view.in_effect.exposure).mid_exposure;
  view.received = times(view.in_effect.exposure).received;
  view.verdict = frame.verdict;
  if (channel_->no_signal && view.verdict == FrameVerdict::kGood) view.verdict = FrameVerdict::kNoSignal;
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
  if (state() != State::kStreaming) return;  // queued when the stream runs again
  if (channel_->stream.queue(slot) == 0) {
    slots_[slot] = Slot::kQueued;
  } else {
    ++counts().refused_buffers;  // take_frame() tries again
  }
}

}  // namespace nodal::hal::v4l2
