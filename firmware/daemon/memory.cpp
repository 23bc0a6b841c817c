#include "firmware/daemon/memory.h"

#include <fmt/format.h>

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>

#include "protocol/files/open_file.h"

namespace nodal::daemon {

// Left to itself the C library keeps blocks as large as the largest that was ever freed among the small ones.
void keep_large_blocks_apart() {
  ::mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  ::mallopt(M_ARENA_MAX, kArenas);
}

std::string explain_refused_memory() {
  constexpr std::uint64_t kMiB = 1 << 20;
  std::string text = "memory or a thread was refused";
  if (const Result<FilePtr> file = open_to_read("/proc/self/statm")) {
    unsigned long pages = 0;
    if (std::fscanf(file->get(), "%lu", &pages) == 1) {
      text += fmt::format(" with {} MiB of addresses in use",
                          pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) / kMiB);
    }
  }
  rlimit limit{};
  const bool limited = ::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
  if (limited) text += fmt::format(", and the limit (ulimit -v) is {} MiB", limit.rlim_cur / kMiB);
  return text +
         "; raise the limits on addresses, memory and threads (ulimit -v, MemoryMax=, TasksMax=), or make the "
         "raymap in rig.toml smaller";
}

void give_back_memory() { ::malloc_trim(0); }

}  // namespace nodal::daemon
