#include "measure.h"

#include <sys/resource.h>

#include <algorithm>
#include <ctime>
#include <thread>

namespace nodal::bench {
namespace {

double clock_ms(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

long interruptions() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_nivcsw;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

double clock_time_ms() { return clock_ms(CLOCK_MONOTONIC); }
double process_time_ms() { return clock_ms(CLOCK_PROCESS_CPUTIME_ID); }

struct Pool::State {
  std::vector<std::jthread> threads;
  const std::function<void(int)>* band = nullptr;
  int bands = 0;
  std::atomic<int> next{0};
  std::atomic<int> working{0};
  std::atomic<unsigned> frame{0};
  std::atomic<bool> end{false};

  void work() {
    for (int b; (b = next.fetch_add(1)) < bands;) (*band)(b);
  }
};

Pool::Pool(int threads) : state_(std::make_unique<State>()) {
  for (int t = 1; t < threads; ++t) {
    state_->threads.emplace_back([s = state_.get()] {
      for (unsigned seen = 0;;) {
        s->frame.wait(seen);
        seen = s->frame.load();
        if (s->end.load()) return;
        s->work();
        s->working.fetch_sub(1);
        s->working.notify_all();
      }
    });
  }
}

Pool::~Pool() {
  state_->end.store(true);
  state_->frame.fetch_add(1);
  state_->frame.notify_all();
}

void Pool::run(int bands, const std::function<void(int)>& band) {
  state_->band = &band;
  state_->bands = bands;
  state_->next.store(0);
  state_->working.store(static_cast<int>(state_->threads.size()));
  state_->frame.fetch_add(1);
  state_->frame.notify_all();
  state_->work();
  for (int left; (left = state_->working.load()) != 0;) state_->working.wait(left);
}

void Times::take(const std::function<void()>& frame) {
  const clockid_t clock = threads_ == 1 ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC;
  const long before = interruptions();
  const double begin = clock_ms(clock);
  frame();
  const double ms = clock_ms(clock) - begin;
  all_.push_back(ms);
  if (interruptions() == before) undisturbed_.push_back(ms);
}

double Times::median_ms() const { return median(undisturbed_.size() >= 3 ? undisturbed_ : all_); }

}  // namespace nodal::bench
