// A program that runs beside this one, with pipes to and from it: ffmpeg, ffprobe, nginx, avahi-browse.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "protocol/base/result.h"

namespace nodal {

struct ChildSpec {
  std::string program;                 ///< path
  std::vector<std::string> arguments;  ///< without the program's name; given as they are, no shell reads them
  bool input = false;                  ///< a pipe to its standard input; else that is /dev/null
  bool output = false;                 ///< a pipe from its standard output; else that is /dev/null
  bool writes_files = false;           ///< false: it may not write to any file (RLIMIT_FSIZE 0)
  std::uint64_t memory = 0;            ///< bytes of address space that it may have (RLIMIT_AS); 0: no limit
  std::string folder{};                ///< working directory; empty: this process's
};

/// It is in a process group of its own, so that Ctrl-C reaches this program alone, and is killed when this one ends.
/// A thread reads its standard error, so that no amount of it makes the program wait; kMaxComplaint bytes are kept.
///
/// Threading: thread-bound; input() and output() may be used by one other thread each.
/// Ownership: closes the pipes; kills a program that still runs.
/// Errors: kIo if it cannot be started.
class Child {
 public:
  static constexpr std::size_t kMaxComplaint = 4096;

  static Result<std::unique_ptr<Child>> start(const ChildSpec& spec);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Reads up to `into.size()` bytes; 0 at the end. Errors: kIo.
  Result<std::size_t> read(std::span<std::uint8_t> into);
  /// Everything that it writes to standard output. Errors: kTooLarge beyond `limit`.
  Result<std::string> read_all(std::size_t limit);
  /// Errors: kLinkClosed if the program has closed its input or ended.
  Status write(std::span<const std::uint8_t> bytes);
  void close_input();

  /// Kills it, as the destructor does, which waits for its end: another thread's read() or write() then returns.
  void kill();

  struct End {
    int code = 0;    ///< exit code
    int signal = 0;  ///< signal that ended it; 0: none
    bool good() const { return code == 0 && signal == 0; }
  };
  /// Waits for its end.
  End wait();
  /// The beginning of what it wrote to standard error, in one line. After wait().
  std::string complaint() const;

 private:
  Child() = default;
  void collect();

  pid_t pid_ = -1;
  int input_ = -1;
  int output_ = -1;
  int errors_ = -1;
  bool ended_ = false;
  End end_;
  std::string complaint_;
  std::thread collector_;
};

/// What went wrong with a program, as the end of a sentence: "was killed by SIGKILL", "failed: moov atom not found".
std::string end_of(const Child::End& end, const std::string& complaint);

}  // namespace nodal
