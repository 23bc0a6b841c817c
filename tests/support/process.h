// Runs real programs in tests: start, input, wait, with a timeout after which a test fails instead of hanging.
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

/// A running program; it is killed by the destructor, and with the test that started it.
class Process {
 public:
  /// `environment` is added to ours. Standard output and error are kept for reading.
  Process(const std::vector<std::string>& command, const std::map<std::string, std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// Its standard output so far; the next function: its standard error.
  std::string said();
  std::string complained();
  /// Limits the pipe of standard error to one page from now on, for tests that do not read it.
  void narrow() const;
  /// Waits for its end; kills it (code 137) after `at_most`.
  Finished wait(std::chrono::seconds at_most = std::chrono::seconds(110));

 private:
  void read_more();
  pid_t pid_ = -1;
  int out_ = -1;
  int err_ = -1;
  Finished finished_;
};

/// Checks every few milliseconds until `holds` is true; returns false after `at_most`. For conditions that other
/// processes fulfil, instead of a fixed sleep.
bool wait_until(const std::function<bool()>& holds, std::chrono::seconds at_most = std::chrono::seconds(60));

}  // namespace nodal::test
