#include "hal/linux/cable/answer_thread.h"

#include <unistd.h>

#include <utility>

namespace nodal::hal::cable {

AnswerThread::AnswerThread(std::shared_ptr<const int> ep0) : shared_(std::make_shared<Shared>()) {
  Thread(
      "nodal-cable", "", [shared = shared_, ep0 = std::move(ep0)] { return work(*shared, *ep0); },
      [shared = shared_] { wait(*shared); })
      .detach();
}

AnswerThread::~AnswerThread() {
  const std::lock_guard lock(shared_->mutex);
  shared_->stop = true;
  shared_->changed.notify_one();
}

void AnswerThread::write(std::span<const std::uint8_t> answer) {
  const std::lock_guard lock(shared_->mutex);
  shared_->answer.emplace(answer.begin(), answer.end());
  shared_->changed.notify_one();
}

bool AnswerThread::busy() const {
  const std::lock_guard lock(shared_->mutex);
  return shared_->answer.has_value() || shared_->writing;
}

Round AnswerThread::work(Shared& shared, int ep0) {
  std::unique_lock lock(shared.mutex);
  if (shared.stop) return Round::kEnd;
  if (!shared.answer) return Round::kSleep;
  const std::vector<std::uint8_t> answer = *std::exchange(shared.answer, std::nullopt);
  shared.writing = true;
  lock.unlock();
  // Fails when the host sent another request or was unplugged: whatever it needs, it requests again.
  [[maybe_unused]] const auto written = ::write(ep0, answer.data(), answer.size());
  lock.lock();
  shared.writing = false;
  return Round::kAgain;
}

void AnswerThread::wait(Shared& shared) {
  std::unique_lock lock(shared.mutex);
  shared.changed.wait(lock, [&] { return shared.stop || shared.answer.has_value(); });
}

}  // namespace nodal::hal::cable
