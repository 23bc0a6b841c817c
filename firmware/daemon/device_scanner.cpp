#include "firmware/daemon/device_scanner.h"

#include <mutex>
#include <system_error>
#include <utility>

#include "firmware/daemon/scan_report.h"
#include "hal/linux/iidc/camera.h"
#include "hal/linux/thread/thread.h"
#include "protocol/base/try.h"

namespace nodal::daemon {

namespace {

Result<firmware::DeviceList> list_of(const std::vector<hal::v4l2::FoundDevice>& devices) {
  NODAL_TRY_ASSIGN(std::string text, scan_text(devices));
  NODAL_TRY_ASSIGN(std::string json, scan_json(devices));
  return firmware::DeviceList{std::move(text), std::move(json)};
}

}  // namespace

std::vector<hal::v4l2::FoundDevice> MachineDevices::scan(std::chrono::milliseconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  Result<std::vector<hal::iidc::CameraInfo>> found = fail(Errc::kInternal, "");
  hal::Thread cameras("nodal-scan", "iidc:", [&] { found = iidc_.list(patience); });
  std::vector<hal::v4l2::FoundDevice> all =
      v4l2_.scan(std::chrono::duration_cast<std::chrono::milliseconds>(until - std::chrono::steady_clock::now()));
  cameras.join();
  if (!found) {
    hal::v4l2::FoundDevice silent;
    silent.node = silent.port = "iidc:";
    silent.problem = found.error();
    all.push_back(std::move(silent));
    return all;
  }
  for (const hal::iidc::CameraInfo& info : *found) {
    hal::v4l2::FoundDevice camera;
    camera.node = camera.port = hal::iidc::port_of(info.guid);
    camera.model = "IIDC camera";
    camera.driver = "libdc1394";
    camera.listed_only = "an IIDC camera is only listed; RIG.md (IIDC cameras) says what its entry in [[heads]] needs";
    all.push_back(std::move(camera));
  }
  return all;
}

struct DeviceScanner::Shared {
  MachineDevices devices;  ///< used only by the scan's thread while one runs
  std::mutex mutex;        ///< protects the following members
  bool running = false;
  std::optional<Result<firmware::DeviceList>> result;
};

DeviceScanner::DeviceScanner() : shared_(std::make_shared<Shared>()) {}

void DeviceScanner::begin() {
  {
    const std::lock_guard lock(shared_->mutex);
    if (std::exchange(shared_->running, true)) return;
    shared_->result.reset();
  }
  try {
    hal::Thread("nodal-scan", "", [shared = shared_] {
      const auto devices = shared->devices.scan(kScanWithin);
      Result<firmware::DeviceList> list = list_of(devices);
      const std::lock_guard lock(shared->mutex);
      shared->result = std::move(list);
      shared->running = false;
    }).detach();
  } catch (const std::system_error&) {
    const std::lock_guard lock(shared_->mutex);
    shared_->result =
        fail(Errc::kOverload, "the system refuses a thread for the scan; raise the limit (TasksMax=, ulimit -u)");
    shared_->running = false;
  }
}

std::optional<Result<firmware::DeviceList>> DeviceScanner::take() {
  const std::lock_guard lock(shared_->mutex);
  return std::exchange(shared_->result, std::nullopt);
}

}  // namespace nodal::daemon
