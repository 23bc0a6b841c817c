// Takes rights away from the calling process, for the rest of its life: files and network with Landlock, system calls
// with seccomp, memory and processor time with resource limits. For programs that read data of strangers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::hal::linux_os {

/// What a confined process may still do. Everything else is denied: no other file, no network, no other program, no
/// tracing or signalling of other processes.
struct Confinement {
  /// Files, and folders with everything beneath. One that is not there is left out; a symbolic link is followed. To
  /// follow none, open the folder and name it "/proc/self/fd/7".
  std::vector<std::string> read{};
  /// As `read`, and files in these folders may also be written, made, renamed and removed.
  std::vector<std::string> write{};
  /// Programs that may be started. They keep these restrictions. Empty: none, and execve() is denied.
  std::vector<std::string> execute{};

  enum class Calls : std::uint8_t {
    kFilesAndMemory,  ///< an allow-list for a process with one thread that computes, reads and writes files
    kProgram,  ///< a deny-list for a whole program: threads, pipes and Unix sockets stay; Internet sockets do not
  };
  Calls calls = Calls::kProgram;
  bool unix_sockets = true;        ///< kProgram: false: no new socket at all; those that are open stay
  std::uint64_t memory_bytes = 0;  ///< limit of addresses (RLIMIT_AS); 0: none
  std::uint32_t cpu_seconds = 0;   ///< limit of processor time (RLIMIT_CPU); 0: none
};

/// What is in force.
struct Confined {
  /// Version of the kernel's interface; 0: the kernel has no Landlock (Linux 5.13 has), or it is off.
  int landlock = 0;
  bool seccomp = false;   ///< false: the kernel has no seccomp filters
  std::string missing{};  ///< a sentence for the log about what the kernel lacks; empty: nothing
};

/// Restricts the calling thread and what it starts from now on. Call it before the process has a second thread. What
/// the kernel lacks is left out and told in Confined::missing. Files that are open stay open.
///
/// Threading: thread-bound. Errors: kIo if the kernel has a restriction and refuses to apply it.
Result<Confined> confine(const Confinement& what);

/// Confined::missing of this kernel, without restricting anything.
std::string missing_in_kernel();

}  // namespace nodal::hal::linux_os
