// Work cut into chunks whose number does not depend on the number of threads, so that sums taken chunk by chunk are
// the same to the bit however many there are.
#pragma once

#include <atomic>
#include <thread>
#include <vector>

namespace nodal::registration {

/// Threading: thread-bound; run() starts its threads and waits for them.
class Workers {
 public:
  /// 0: one a core.
  explicit Workers(int threads)
      : threads_(threads > 0 ? threads : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()))) {}

  int threads() const { return threads_; }

  /// Calls work(i) once for every i in 0..chunks-1, in any order, on any thread. work must not throw.
  template <class Work>
  void run(int chunks, const Work& work) const {
    std::atomic<int> next{0};
    const auto labour = [&] {
      for (int i = next.fetch_add(1); i < chunks; i = next.fetch_add(1)) work(i);
    };
    std::vector<std::thread> others;
    for (int t = 1; t < std::min(threads_, chunks); ++t) others.emplace_back(labour);
    labour();
    for (std::thread& other : others) other.join();
  }

 private:
  int threads_;
};

}  // namespace nodal::registration
