// Runs chunks of work on several threads. If the number of chunks does not depend on the number of threads, sums that
// are computed chunk by chunk are the same to the bit for any number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <thread>
#include <vector>

namespace nodal::parallel {

/// Threading: thread-bound; run() starts its threads and waits for them.
class Workers {
 public:
  /// `threads` 0: one per core.
  explicit Workers(int threads)
      : threads_(threads > 0 ? threads : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()))) {}

  int threads() const { return threads_; }

  /// Calls work(i) once for every i in 0..chunks-1, in any order, on any thread. work must not throw.
  template <class Work>
  void run(int chunks, const Work& work) const {
    std::atomic<int> next{0};
    const auto work_off = [&] {
      for (int i = next.fetch_add(1); i < chunks; i = next.fetch_add(1)) work(i);
    };
    std::vector<std::thread> others;
    for (int t = 1; t < std::min(threads_, chunks); ++t) others.emplace_back(work_off);
    work_off();
    for (std::thread& other : others) other.join();
  }
  /// The same. `progress`, if given, is called on the caller's thread with the share of the chunks that are done, after
  /// each chunk that this thread has done.
  template <class Work>
  void run(int chunks, const Work& work, const std::function<void(double)>& progress) const {
    const std::thread::id caller = std::this_thread::get_id();
    std::atomic<int> done{0};
    run(chunks, [&](int i) {
      work(i);
      const int now = done.fetch_add(1) + 1;
      if (progress && std::this_thread::get_id() == caller) progress(static_cast<double>(now) / chunks);
    });
  }

 private:
  int threads_;
};

}  // namespace nodal::parallel
