#include "hal/linux/device/enumerator.h"

#include <chrono>
#include <future>
#include <optional>
#include <utility>

namespace nodal::hal::device {

struct DeviceEnumerator::Path {
  explicit Path(const std::string& path) : worker(path) {}
  Attempt attempt;
  std::shared_ptr<bool> in_use = std::make_shared<bool>(false);
  std::weak_ptr<Channel> channel;  ///< channel of the head that uses the device
  std::optional<std::future<Opened>> opening;
  std::optional<Error> last;
  Worker worker;  ///< declared last, so destroyed first: its jobs use the members above
};

DeviceEnumerator::DeviceEnumerator(ClockPort& clock, std::string scheme, std::string kind)
    : clock_(clock), scheme_(std::move(scheme)), kind_(std::move(kind)) {}

DeviceEnumerator::~DeviceEnumerator() {
  for (const auto& [name, path] : paths_) NODAL_ASSERT(!*path->in_use);  // destroy heads first
}

DeviceEnumerator::Path& DeviceEnumerator::at(const std::string& path) {
  std::unique_ptr<Path>& found = paths_[path];
  if (!found) {
    found = std::make_unique<Path>(path);
    found->attempt = usual_attempt(path);
  }
  return *found;
}

void DeviceEnumerator::set_attempt(const std::string& path, Attempt attempt) {
  Path& one = at(path);
  one.attempt = std::move(attempt);
  one.opening.reset();  // an attempt in progress used the previous request
}

Result<std::unique_ptr<HeadPort>> DeviceEnumerator::open(const std::string& path) {
  if (!path.starts_with(scheme_)) {
    return fail(Errc::kNoSuchDevice, "head '" + path + "': " + kind_ + " path begins with '" + scheme_ + "'");
  }
  Path& one = at(path);
  if (*one.in_use) {
    // A head from which no frame was requested since its device went has not yet detected that it is gone.
    const std::shared_ptr<Channel> channel = one.channel.lock();
    if (!channel || !channel->gone()) return fail(Errc::kBusy, "head '" + path + "': is open already");
    *std::exchange(one.in_use, std::make_shared<bool>(false)) = false;
  }
  if (!one.opening) {
    auto job = std::make_shared<std::packaged_task<Opened()>>(one.attempt);
    one.opening = job->get_future();
    one.worker.post([job] { (*job)(); });
  }
  if (one.opening->wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    if (one.last) return fail(*one.last);
    return fail(Errc::kNotReady, "head '" + path + "': is being opened");
  }
  Opened opened = one.opening->get();
  one.opening.reset();
  if (!opened) {
    one.last = opened.error();
    return fail(opened.error());
  }
  one.last.reset();
  one.channel = *opened;
  return make_head(path, std::move(*opened), one.worker, clock_, one.in_use);
}

Result<std::unique_ptr<HeadPort>> DeviceEnumerator::open_and_wait(const std::string& path) {
  if (path.starts_with(scheme_)) {
    Path& one = at(path);
    one.worker.settle();
    if (!one.opening) {
      auto at_once = open(path);
      if (!one.opening) return at_once;  // the device answered at once, or no attempt was made
    }
    one.worker.settle();
  }
  return open(path);
}

void DeviceEnumerator::settle() {
  for (const auto& [name, path] : paths_) path->worker.settle();
}

}  // namespace nodal::hal::device
