// A head on an IIDC camera.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/linux/device/head.h"
#include "hal/linux/device/usb.h"
#include "hal/linux/iidc/controls.h"
#include "hal/linux/iidc/embedded.h"
#include "hal/linux/iidc/negotiation.h"
#include "hal/linux/iidc/stream.h"

namespace nodal::hal::iidc {

class Channel final : public device::Channel {
 public:
  Channel(std::unique_ptr<Camera> opened, const HeadRequest& asked, Granted given, std::unique_ptr<Controls> found,
          HeadSettings now, bool has_embedded, device::UsbBuses::Share bandwidth)
      : camera(std::move(opened)),
        request(asked),
        granted(std::move(given)),
        controls(std::move(found)),
        opened_with(now),
        embedded(has_embedded),
        share(std::move(bandwidth)),
        stream(*camera, granted) {}

  const HeadFormat& format() const override { return granted.format; }
  const HeadLimits& limits() const override { return controls->limits(); }
  const HeadSettings& settings() const override { return opened_with; }
  bool gone() const override { return camera->gone(); }
  Status set(const device::ControlChange& change) override { return controls->set(*camera, change); }
  Result<HeadSettings> read() override { return controls->read(*camera); }
  void end() override { stream.end(); }

  const std::unique_ptr<Camera> camera;
  const HeadRequest request;
  const Granted granted;
  const std::unique_ptr<Controls> controls;
  const HeadSettings opened_with;
  const bool embedded;                  ///< its pictures begin with embedded numbers
  const device::UsbBuses::Share share;  ///< its share of the USB bus; null if the camera is on none
  Stream stream;                        ///< see device::DeviceHead
};

/// take_frame() and release() take and return buffers of the stream; everything else is a job of the worker.
///
/// Threading, Ownership, Errors: as device::DeviceHead.
class IidcHead final : public device::DeviceHead {
 public:
  IidcHead(std::string path, std::shared_ptr<Channel> channel, device::Worker& worker, ClockPort& clock,
           std::shared_ptr<bool> in_use);

  Result<std::optional<FrameView>> take_frame() override;
  void add_wake_ups(WakeUps& to) const override;
  void release(BufferSlot slot) override;

 private:
  enum class Slot : std::uint8_t { kQueued, kLent, kRefused };

  Result<StreamJob> begin(TriggerMode trigger) override;
  void on_stream_start() override;
  void stopped() override;
  void return_refused();
  bool give_back(std::size_t slot);
  void restart_stream();
  FrameView view(const RawFrame& frame, Instant now);
  /// Whether these bytes are not where a picture begins, although they were in an earlier picture of this stream.
  bool displaced(const EmbeddedInfo& embedded);
  std::uint32_t number(const RawFrame& frame, const std::optional<EmbeddedInfo>& embedded);

  std::shared_ptr<Channel> channel_;
  std::vector<Slot> slots_;
  std::optional<std::uint32_t> sequence_;  ///< number of the newest frame
  Instant last_at_;                        ///< time of the newest frame
  bool marked_ = false;                    ///< a picture of this stream had marked numbers
  bool displaced_ = false;                 ///< the newest frame
};

}  // namespace nodal::hal::iidc
