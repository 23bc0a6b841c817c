// Runs work in a process of its own that may use so many addresses more than it has when it begins.
#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <functional>
#include <new>

#include "tests/support/limits_page.h"

namespace nodal::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kLimitsAddresses = false;  // a sanitizer reserves terabytes
#else
inline constexpr bool kLimitsAddresses = true;
#endif

/// Whether `work` returns true within `mib` MiB.
inline testing::AssertionResult within_memory(std::uint64_t mib, const std::function<bool()>& work) {
  if (!kLimitsAddresses) return work() ? testing::AssertionSuccess() : testing::AssertionFailure() << "false";
  constexpr int kFalse = 1, kRefused = 2, kNoLimit = 3;
  const pid_t child = ::fork();
  if (child == 0) {
    unsigned long pages = 0;
    std::FILE* const file = std::fopen("/proc/self/statm", "r");
    const bool known = file != nullptr && std::fscanf(file, "%lu", &pages) == 1;
    if (file) std::fclose(file);
    const rlim_t most = pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + (mib << 20);
    const rlimit limit{most, most};
    if (!known || ::setrlimit(RLIMIT_AS, &limit) != 0) ::_exit(kNoLimit);
    try {
      ::_exit(work() ? 0 : kFalse);
    } catch (const std::bad_alloc&) {
      ::_exit(kRefused);
    }
  }
  int status = 0;
  if (::waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0)
    return testing::AssertionSuccess();
  if (WIFEXITED(status) && WEXITSTATUS(status) == kRefused)
    return testing::AssertionFailure() << "needs more than " << mib << " MiB";
  return testing::AssertionFailure() << "ends with status " << status;
}

}  // namespace nodal::test
