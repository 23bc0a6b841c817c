#include "hal/linux/thread/thread.h"

#include <pthread.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <list>
#include <mutex>
#include <utility>

namespace nodal::hal {
namespace {

/// The kernel's clock: a virtual clock of the rig says nothing about threads.
std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

struct Pulse {
  std::string name;
  std::atomic<std::int64_t> busy_since_ns{0};  ///< 0: it sleeps
};

struct Pulses {
  std::mutex mutex;
  std::list<Pulse> all;  ///< a place does not move
};

/// Never destroyed, because detached threads may outlive static objects.
Pulses& pulses() {
  static Pulses* const pulses = new Pulses;
  return *pulses;
}

thread_local Pulse* mine = nullptr;

/// On its thread, from the first to the last moment.
class Registered {
 public:
  explicit Registered(std::string name) {
    const std::lock_guard lock(pulses().mutex);
    place_ = pulses().all.emplace(pulses().all.end());
    place_->name = std::move(name);
    mine = &*place_;
  }
  ~Registered() {
    mine = nullptr;
    const std::lock_guard lock(pulses().mutex);
    pulses().all.erase(place_);
  }
  Registered(const Registered&) = delete;
  Registered& operator=(const Registered&) = delete;

 private:
  std::list<Pulse>::iterator place_;
};

/// New threads inherit the mask: only signals that report a crash of this thread reach it.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    for (const int crash : {SIGILL, SIGTRAP, SIGABRT, SIGBUS, SIGFPE, SIGSEGV, SIGSYS}) sigdelset(&all, crash);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

std::thread started(const char* name, std::function<void()> run) {
  const SignalsBlocked blocked;
  std::thread thread(std::move(run));
  pthread_setname_np(thread.native_handle(), name);
  return thread;
}

std::string full_name(const char* name, const std::string& of_what) {
  return of_what.empty() ? name : name + (" " + of_what);
}

}  // namespace

void beat() {
  if (mine) mine->busy_since_ns.store(now_ns(), std::memory_order_relaxed);
}

Thread::Thread(const char* name, std::string of_what, Work work, Sleep sleep)
    : thread_(started(name, [full = full_name(name, of_what), work = std::move(work), sleep = std::move(sleep)] {
        const Registered registered(full);
        for (;;) {
          beat();
          const Round next = work();
          if (next == Round::kEnd) return;
          if (next == Round::kAgain) continue;
          mine->busy_since_ns.store(0, std::memory_order_relaxed);
          sleep();
        }
      })) {}

Thread::Thread(const char* name, std::string of_what, std::function<void()> once)
    : Thread(
          name, std::move(of_what),
          [once = std::move(once)] {
            once();
            return Round::kEnd;
          },
          [] {}) {}

void Heartbeats::read(std::vector<Heartbeat>& into) {
  into.clear();
  const std::int64_t now = now_ns();
  const std::lock_guard lock(pulses().mutex);
  for (const Pulse& pulse : pulses().all) {
    const std::int64_t since = pulse.busy_since_ns.load(std::memory_order_relaxed);
    into.push_back({pulse.name, Duration::nanoseconds(since == 0 ? 0 : std::max<std::int64_t>(now - since, 0))});
  }
}

}  // namespace nodal::hal
