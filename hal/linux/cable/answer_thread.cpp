#include "hal/linux/cable/answer_thread.h"

#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <thread>
#include <utility>

namespace nodal::hal::cable {

AnswerThread::AnswerThread(std::shared_ptr<const int> ep0) : shared_(std::make_shared<Shared>()) {
  // The thread inherits the mask: it must not take the signals that end the program.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, &before);
  std::thread(run, shared_, std::move(ep0)).detach();
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
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

void AnswerThread::run(const std::shared_ptr<Shared>& shared, const std::shared_ptr<const int>& ep0) {
  pthread_setname_np(pthread_self(), "nodal-cable");
  std::unique_lock lock(shared->mutex);
  while (true) {
    shared->changed.wait(lock, [&] { return shared->stop || shared->answer.has_value(); });
    if (shared->stop) return;
    const std::vector<std::uint8_t> answer = *std::exchange(shared->answer, std::nullopt);
    shared->writing = true;
    lock.unlock();
    // Fails when the host sent another request or was unplugged: whatever it needs, it requests again.
    [[maybe_unused]] const auto written = ::write(*ep0, answer.data(), answer.size());
    lock.lock();
    shared->writing = false;
  }
}

}  // namespace nodal::hal::cable
