#include "hal/linux/device/worker.h"

#include <utility>

namespace nodal::hal::device {

Worker::Worker(std::string of_what)
    : thread_(
          "nodal-device", std::move(of_what), [this] { return work(); }, [this] { wait(); }) {}

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Worker::post(std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
  }
  changed_.notify_all();
}

bool Worker::idle() const {
  const std::lock_guard lock(mutex_);
  return jobs_.empty() && !working_;
}

void Worker::settle() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return jobs_.empty() && !working_; });
}

Round Worker::work() {
  std::unique_lock lock(mutex_);
  if (jobs_.empty()) return stop_ ? Round::kEnd : Round::kSleep;
  std::function<void()> job = std::move(jobs_.front());
  jobs_.pop_front();
  working_ = true;
  lock.unlock();
  job();
  job = nullptr;  // releases its captures on this thread
  lock.lock();
  working_ = false;
  changed_.notify_all();
  return Round::kAgain;
}

void Worker::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stop_ || !jobs_.empty(); });
}

}  // namespace nodal::hal::device
