#include "hal/linux/iidc/lister.h"

#include <condition_variable>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "hal/linux/thread/thread.h"

namespace nodal::hal::iidc {

/// It outlives the Lister if its thread hangs.
struct Lister::Answer {
  std::mutex mutex;
  std::condition_variable changed;
  bool asked = false;  ///< a thread has not answered yet
  std::optional<std::vector<CameraInfo>> cameras;
};

Lister::Lister(Bus& bus) : bus_(bus), answer_(std::make_shared<Answer>()) {}

Result<std::vector<CameraInfo>> Lister::list(std::chrono::milliseconds patience) {
  std::unique_lock lock(answer_->mutex);
  if (!answer_->asked) {
    answer_->cameras.reset();
    try {
      Thread("nodal-scan", "iidc:", [&bus = bus_, answer = answer_] {
        std::vector<CameraInfo> found = bus.list();
        const std::lock_guard relock(answer->mutex);
        answer->cameras = std::move(found);
        answer->asked = false;
        answer->changed.notify_all();
      }).detach();
    } catch (const std::system_error&) {
      return fail(Errc::kOverload,
                  "IIDC cameras: the system refuses a thread to list them; raise the limit (TasksMax=, ulimit -u)");
    }
    answer_->asked = true;
  }
  if (!answer_->changed.wait_for(lock, patience, [this] { return answer_->cameras.has_value(); })) {
    return fail(Errc::kTimeout, "IIDC cameras: one does not answer; unplug it and plug it in again");
  }
  return *std::exchange(answer_->cameras, std::nullopt);
}

}  // namespace nodal::hal::iidc
