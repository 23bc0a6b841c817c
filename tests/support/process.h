// Real programs for tests: start, feed, wait, with a time after which a test fails instead of hanging.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace nodal::test {

struct Finished {
  int code = -1;  ///< exit code, or 128 + the signal that ended it
  std::string out;
  std::string err;
};

/// A program that runs; it is killed with the object, and with the test that started it.
class Process {
 public:
  /// `environment` goes over ours. Standard output and error are kept to be read.
  Process(const std::vector<std::string>& command, const std::map<std::string, std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// What it has said on standard output so far, and on standard error.
  std::string said();
  std::string complained();
  /// Standard error holds a page from here on, for tests that do not read it.
  void narrow() const;
  /// Its end; killed (code 137) when it takes longer.
  Finished wait(std::chrono::seconds at_most = std::chrono::seconds(60));

 private:
  void read_more();
  pid_t pid_ = -1;
  int out_ = -1;
  int err_ = -1;
  Finished finished_;
};

/// Tries again every few milliseconds until it holds; false when that takes longer. For what other processes do:
/// without a fixed sleep.
bool wait_until(const std::function<bool()>& holds, std::chrono::seconds at_most = std::chrono::seconds(60));

}  // namespace nodal::test
