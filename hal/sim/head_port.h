// The port of an open simulated head. Used by head.cpp and head_port.cpp only.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "hal/head.h"
#include "hal/sim/head.h"

namespace nodal::hal::sim {

/// It owns the buffers, so that lent pictures stay readable after the head is gone.
class SimHead::Port final : public HeadPort {
 public:
  explicit Port(SimHead& head)
      : head_(&head),
        identity_(head.identity_),
        format_{head.options_.pixels, head.truth().width, head.truth().height, head.options_.fields,
                head.options_.rate},
        limits_(head.options_.limits),
        buffers_(static_cast<std::size_t>(head.options_.buffers)) {
    const PixelFormat sensed = sensor_options(head.options_).pixels;
    for (Buffer& buffer : buffers_) buffer.content.bytes.resize(packed_size(sensed, format_.width, format_.height));
  }
  ~Port() override {
    stop();
    if (head_ != nullptr) head_->port_ = nullptr;
  }

  const HeadIdentity& identity() const override { return identity_; }
  const HeadFormat& format() const override { return format_; }
  const HeadLimits& limits() const override { return limits_; }

  Status start(TriggerMode trigger) override {
    if (head_ == nullptr) return fail(gone());
    return head_->start(trigger);
  }
  void stop() override {
    if (head_ != nullptr) head_->stop();
  }
  Status set_exposure(Exposure exposure) override;
  Status set_gain(Gain gain) override;
  Status set_white_balance(WhiteBalance balance) override;
  Status set_gamma(Gamma gamma) override;
  Status nudge(Duration by) override {
    if (head_ == nullptr) return fail(gone());
    return head_->nudge(by);
  }
  Result<std::optional<FrameView>> take_frame() override;
  void add_wake_ups(WakeUps& to) const override {
    if (const auto next = head_ != nullptr ? head_->next_arrival() : std::nullopt) to.at(*next);
  }
  void release(BufferSlot slot) override {
    if (slot < buffers_.size() && buffers_[slot].state == Buffer::State::kLent) {
      buffers_[slot].state = Buffer::State::kFree;
    }
  }

  /// The driver's part. Returns false if no buffer is free.
  bool fill(const ExposedFrame& frame) {
    for (std::size_t slot = 0; slot < buffers_.size(); ++slot) {
      if (buffers_[slot].state != Buffer::State::kFree) continue;
      buffers_[slot].state = Buffer::State::kFilled;
      buffers_[slot].frame = frame;
      filled_.push_back(static_cast<BufferSlot>(slot));
      return true;
    }
    return false;
  }
  /// Takes back all buffers. Returns how many held a frame that was not taken.
  std::size_t take_back() {
    const std::size_t untaken = filled_.size();
    filled_.clear();
    for (Buffer& buffer : buffers_) buffer.state = Buffer::State::kFree;
    return untaken;
  }
  /// From now on every call returns kDeviceGone; lent buffers stay valid.
  std::size_t vanish() {
    const std::size_t untaken = filled_.size();
    filled_.clear();
    head_ = nullptr;
    return untaken;
  }

 private:
  struct Buffer {
    enum class State : std::uint8_t { kFree, kFilled, kLent } state = State::kFree;
    BufferContent content;
    ExposedFrame frame;
  };

  Error gone() const { return {Errc::kDeviceGone, "head '" + identity_.path + "': unplugged; plug it in again"}; }

  SimHead* head_;  ///< null once unplugged
  const HeadIdentity identity_;
  const HeadFormat format_;
  const HeadLimits limits_;
  std::vector<Buffer> buffers_;
  std::deque<BufferSlot> filled_;
};

}  // namespace nodal::hal::sim
