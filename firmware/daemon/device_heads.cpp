#include "firmware/daemon/device_heads.h"

#include "firmware/daemon/drivers.h"
#include "firmware/rig.h"

namespace nodal::daemon {
namespace {

using firmware::DeviceConfig;
using firmware::HeadConfig;
using firmware::PortKind;
using firmware::RigConfig;
using firmware::SyncSource;

constexpr int kDeviceBuffers = static_cast<int>(firmware::kFramesAHead);

hal::v4l2::HeadRequest v4l2_request(const RigConfig& config, const HeadConfig& head) {
  hal::v4l2::HeadRequest request;
  request.pixels = head.format;
  request.fields = head.fields;
  request.rate = config.rate;
  request.width = head.device.width;
  request.height = head.device.height;
  request.input = head.device.input;
  request.standard = head.device.standard;
  request.gain_step_mdb = head.device.gain_step_mdb;
  request.readout = head.device.readout;
  request.separate_fields = head.device.separate_fields;
  request.buffers = kDeviceBuffers;
  return request;
}

hal::iidc::HeadRequest iidc_request(const RigConfig& config, const HeadConfig& head) {
  hal::iidc::HeadRequest request;
  request.pixels = head.format;
  request.rate = config.rate;
  request.width = head.device.width;
  request.height = head.device.height;
  request.left = head.device.left;
  request.top = head.device.top;
  request.packet_bytes = head.device.packet_bytes;
  request.triggered = !head.wired && config.trigger.source != SyncSource::kNone;
  request.trigger = {head.device.pulse_is_exposure, config.trigger.active_high};
  request.pulse_width = config.trigger.pulse_width;
  request.gain_step_mdb = head.device.gain_step_mdb;
  request.readout = head.device.readout;
  request.buffers = kDeviceBuffers;
  return request;
}

}  // namespace

DeviceHeads::DeviceHeads(const RigConfig& config, hal::ClockPort& clock) {
  const hal::device::UsbBuses buses;  // shared, because heads of both kinds can be on one bus
  for (const HeadConfig& head : config.heads) {
    if (head.port.kind == PortKind::kV4l2) {
      if (!v4l2_) v4l2_ = std::make_unique<hal::v4l2::V4l2Enumerator>(clock, v4l2_drivers(), buses);
      v4l2_->request(head.port.text(), v4l2_request(config, head));
    } else if (head.port.kind == PortKind::kIidc) {
      if (!iidc_) iidc_ = std::make_unique<hal::iidc::IidcEnumerator>(clock, iidc_cameras(), buses);
      iidc_->request(head.port.text(), iidc_request(config, head));
    }
  }
}

hal::device::DeviceEnumerator* DeviceHeads::of(const std::string& path) const {
  if (path.starts_with("v4l2:")) return v4l2_.get();
  return iidc_.get();
}

Result<std::unique_ptr<hal::HeadPort>> DeviceHeads::open(const std::string& path) {
  hal::device::DeviceEnumerator* const devices = of(path);
  if (devices == nullptr) return fail(Errc::kNoSuchDevice, "nothing opens heads at " + path);
  return devices->open(path);
}

Result<std::unique_ptr<hal::HeadPort>> DeviceHeads::open_and_wait(const std::string& path) {
  hal::device::DeviceEnumerator* const devices = of(path);
  NODAL_ASSERT(devices != nullptr);
  return devices->open_and_wait(path);
}

std::vector<hal::HeadIdentity> DeviceHeads::list() {
  std::vector<hal::HeadIdentity> all;
  if (v4l2_) all = v4l2_->list();
  if (!iidc_) return all;
  const std::vector<hal::HeadIdentity> cameras = iidc_->list();
  all.insert(all.end(), cameras.begin(), cameras.end());
  return all;
}

}  // namespace nodal::daemon
