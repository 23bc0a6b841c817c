// Writes answers to control requests on a thread of their own.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "hal/linux/thread/thread.h"

namespace nodal::hal::cable {

/// The write of an answer returns when the host has taken it, which a host that was killed in the middle of its request
/// never does: the write then lasts until the next request or until the cable is unplugged.
///
/// Threading: thread-bound; its own thread only writes.
/// Ownership: `ep0` stays open until the last write has returned.
class AnswerThread {
 public:
  explicit AnswerThread(std::shared_ptr<const int> ep0);
  /// Does not wait for a write: its thread then ends by itself.
  ~AnswerThread();
  AnswerThread(const AnswerThread&) = delete;
  AnswerThread& operator=(const AnswerThread&) = delete;

  /// Not while busy().
  void write(std::span<const std::uint8_t> answer);
  /// Whether an answer's write has not returned.
  bool busy() const;

 private:
  struct Shared {
    std::mutex mutex;
    std::condition_variable changed;
    std::optional<std::vector<std::uint8_t>> answer;
    bool writing = false;
    bool stop = false;
  };
  static Round work(Shared& shared, int ep0);
  static void wait(Shared& shared);

  std::shared_ptr<Shared> shared_;
};

}  // namespace nodal::hal::cable
