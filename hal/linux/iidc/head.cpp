#include "hal/linux/iidc/head.h"

#include <algorithm>
#include <cerrno>

#include "protocol/base/try.h"

namespace nodal::hal::iidc {
namespace {

std::string serial_of(const CameraInfo& info) { return port_of(info.guid).substr(std::string_view("iidc:").size()); }
std::string model_of(const CameraInfo& info) {
  return info.vendor + (info.vendor.empty() || info.model.empty() ? "" : " ") + info.model;
}

}  // namespace

IidcHead::IidcHead(std::string path, std::shared_ptr<Channel> channel, device::Worker& worker, ClockPort& clock,
                   std::shared_ptr<bool> in_use)
    : DeviceHead({std::move(path), serial_of(channel->camera->info()), model_of(channel->camera->info())}, channel,
                 worker, clock, std::move(in_use)),
      channel_(std::move(channel)) {}

Result<device::DeviceHead::StreamJob> IidcHead::begin(TriggerMode mode) {
  std::optional<TriggerChoice> trigger;
  if (mode == TriggerMode::kExternal) {
    if (!limits().has_trigger_input) {
      return fail(error(Errc::kUnsupported,
                        "the camera has no trigger input of this mode; if the trigger's line is wired to it in another "
                        "way, set trigger_mode = \"wired\" in its entry of rig.toml"));
    }
    trigger = channel_->request.trigger;
  }
  return StreamJob([channel = channel_, trigger, &clock = clock()]() -> Status {
    NODAL_TRY(channel->stream.begin(channel->request.buffers, trigger));
    if (!channel->request.trigger.pulse_width) return {};
    // The trigger decides whether the pulse or the shutter is the exposure.
    channel->controls->set_triggered(trigger.has_value());
    NODAL_TRY_ASSIGN(auto now, channel->read());
    channel->report({Channel::Report::About::kControls, 0, clock.now(), std::nullopt, now});
    return {};
  });
}

void IidcHead::on_stream_start() {
  if (slots_.empty()) slots_.assign(channel_->stream.buffers(), Slot::kQueued);
}

void IidcHead::stopped() {
  slots_.clear();
  sequence_.reset();
  marked_ = false;
}

void IidcHead::return_refused() {
  for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
    if (slots_[slot] == Slot::kRefused && !give_back(slot)) return restart_stream();
  }
}

bool IidcHead::give_back(std::size_t slot) {
  if (channel_->stream.give_back(slot) != 0) return false;
  slots_[slot] = Slot::kQueued;
  return true;
}

void IidcHead::restart_stream() {
  // The source queues what is not lent to it; a refused buffer is tried again after the restart.
  restart([channel = channel_] { return channel->stream.restart(); });
}

Result<std::optional<FrameView>> IidcHead::take_frame() {
  if (state() == State::kStopped) return fail(error(Errc::kWrongState, "take_frame() before start()"));
  take_reports();
  if (state() == State::kStreaming) return_refused();
  if (state() == State::kStreaming) {
    RawFrame frame;
    const Instant now = clock().now();
    const int failed = channel_->stream.take(frame);
    if (failed == 0) {
      slots_[frame.slot] = Slot::kLent;
      const FrameView taken = view(frame, now);
      displaced_ ? restart_stream() : frame_is_good();
      return std::optional<FrameView>{taken};
    }
    if (failed == ENODEV || (failed != EAGAIN && channel_->gone())) {
      fail_for_good(channel_->camera->explained("taking a frame", ENODEV));
    } else if (failed != EAGAIN) {
      restart_stream();
    }
  }
  if (state() == State::kFailed) return fail(why());
  return std::optional<FrameView>{};
}

void IidcHead::add_wake_ups(WakeUps& to) const {
  if (state() == State::kStopped || state() == State::kFailed) return;
  add_report_wake_up(to);
  if (state() == State::kStreaming) channel_->stream.add_wake_ups(to);
}

/// The camera's own number of the frame. Without one, frames are counted as they arrive; those that found no buffer
/// count, too, by their number or by the time that they took.
std::uint32_t IidcHead::number(const RawFrame& frame, const std::optional<EmbeddedInfo>& embedded) {
  if (embedded) return embedded->counter;
  if (!sequence_) return 0;
  std::uint32_t next = *sequence_ + 1 + frame.discarded;
  const Duration period = format().rate.period();
  if (const Duration passed = frame.at - last_at_; frame.starved && passed > period) {
    next += static_cast<std::uint32_t>((passed + period / 2).ns() / period.ns() - 1);
  }
  return next;
}

bool IidcHead::displaced(const EmbeddedInfo& embedded) {
  marked_ |= embedded.marked;
  return marked_ && !embedded.marked;
}

FrameView IidcHead::view(const RawFrame& frame, Instant now) {
  const Granted& granted = channel_->granted;
  const HeadFormat& format = granted.format;
  FrameView view;
  view.slot = static_cast<BufferSlot>(frame.slot);
  if (frame.damaged) view.verdict = FrameVerdict::kCorrupt;
  if (frame.bytes < granted.picture_bytes) view.verdict = FrameVerdict::kTorn;
  std::optional<EmbeddedInfo> embedded;
  displaced_ = false;
  if (channel_->embedded && view.verdict == FrameVerdict::kGood) {
    const std::span picture(frame.data, granted.picture_bytes);
    const std::size_t row = granted.picture_bytes / static_cast<std::size_t>(format.height);
    // Pixels of the same colour: in a mosaic, those two rows below.
    embedded = take_embedded(picture, row, is_bayer(format.pixels) ? 2 : 1);
    if (embedded && displaced(*embedded)) {
      displaced_ = true;
      view.verdict = FrameVerdict::kCorrupt;
      embedded.reset();
    }
  }

  // A transfer begins when the exposure is over, and ends when the last row was read out.
  const Duration readout = channel_->request.readout.value_or(frame.at_begin ? Duration() : format.rate.period());
  const Instant end = std::min(frame.at, now) - readout;
  view.in_effect = settings_of([&](Exposure exposure) { return end - exposure.duration(); });
  if (embedded) {
    const auto exposure = channel_->controls->exposure_of(embedded->shutter);
    const bool by_pulse = channel_->request.trigger.pulse_width;  // the shutter's number then says nothing
    if (exposure && !by_pulse) view.in_effect.exposure = *exposure;
    if (const auto gain = channel_->controls->gain_of(embedded->gain)) view.in_effect.gain = *gain;
  }
  view.mid_exposure = end - view.in_effect.exposure.duration() / 2;
  view.received = frame.at_begin ? now : std::min(frame.at, now);
  view.sequence = number(frame, embedded);
  sequence_ = view.sequence;
  last_at_ = frame.at;
  view.image = packed_image(format.pixels, format.width, format.height, static_cast<const std::uint8_t*>(frame.data));
  return view;
}

void IidcHead::release(BufferSlot slot) {
  if (slot >= slots_.size() || slots_[slot] != Slot::kLent) return;
  slots_[slot] = Slot::kRefused;  // unless the stream takes it now; take_frame() tries again
  if (state() == State::kStreaming && !give_back(slot)) ++counts().refused_buffers;
}

}  // namespace nodal::hal::iidc
