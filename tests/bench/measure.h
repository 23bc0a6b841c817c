// How long a frame takes, on a machine that does other things too.
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

/// Times of one variant's frames. By one thread they are processor time: what others do meanwhile costs caches, not
/// time. By several they are the clock's, of frames that no other program interrupted, as far as there are any.
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

/// The clock's, and what all threads of the process have worked, ms.
double clock_time_ms();
double process_time_ms();

}  // namespace nodal::bench
