// Measures the time of a frame on a machine that also runs other programs.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

namespace nodal::bench {

/// Threads that share the bands of a frame; the caller is one of them.
class Pool {
 public:
  explicit Pool(int threads);
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;
  void run(int bands, const std::function<void(int)>& band);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Times of one variant's frames. With one thread this is processor time, so other programs affect only the caches.
/// With several threads it is clock time, of frames that no other program interrupted if there are any.
class Times {
 public:
  explicit Times(int threads) : threads_(threads) {}
  void take(const std::function<void()>& frame);
  double median_ms() const;

 private:
  int threads_;
  std::vector<double> all_;
  std::vector<double> undisturbed_;
};

/// Clock time, and processor time of all threads of the process, ms.
double clock_time_ms();
double process_time_ms();

}  // namespace nodal::bench
