#include "firmware/daemon/device_scanner.h"

#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "firmware/daemon/scan_report.h"
#include "hal/linux/v4l2/scan.h"

namespace nodal::daemon {

struct DeviceScanner::Shared {
  explicit Shared(hal::v4l2::System& system) : scanner(system) {}
  hal::v4l2::Scanner scanner;  ///< of the scan's thread, while one runs
  std::mutex mutex;            ///< protects the following members
  bool running = false;
  std::optional<Result<firmware::DeviceList>> result;
};

DeviceScanner::DeviceScanner(hal::v4l2::System& system) : shared_(std::make_shared<Shared>(system)) {}

void DeviceScanner::begin() {
  {
    const std::lock_guard lock(shared_->mutex);
    if (std::exchange(shared_->running, true)) return;
    shared_->result.reset();
  }
  try {
    std::thread([shared = shared_] {
      const auto devices = shared->scanner.scan(kScanWithin);
      firmware::DeviceList list{scan_text(devices), scan_json(devices)};
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
