// Replaces the C library's allocation functions by preloading: when a test enables it, allocations of threads with a
// given name fail, as if memory had run out.
#include "refuse_memory.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

namespace {

using nodal::crash::kThreadName;
using nodal::crash::Refusal;

Refusal* refusal = nullptr;

[[gnu::constructor]] void map_refusal() {
  const char* const file = std::getenv(nodal::crash::kRefusalVariable);
  const int fd = file == nullptr ? -1 : ::open(file, O_RDWR | O_CLOEXEC);
  if (fd < 0) return;
  void* const mapped = ::mmap(nullptr, sizeof(Refusal), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  ::close(fd);
  if (mapped != MAP_FAILED) refusal = static_cast<Refusal*>(mapped);
}

bool refuses(std::size_t bytes) {
  if (refusal == nullptr || refusal->on.load() == 0 || bytes < refusal->from_bytes) return false;
  char name[kThreadName] = {};
  ::prctl(PR_GET_NAME, name);
  if (std::strncmp(name, refusal->thread, kThreadName) != 0) return false;
  refusal->refused.fetch_add(1);
  errno = ENOMEM;
  return true;
}

}  // namespace

extern "C" {
void* malloc(std::size_t bytes) { return refuses(bytes) ? nullptr : __libc_malloc(bytes); }
void* calloc(std::size_t count, std::size_t bytes) {
  return refuses(count * bytes) ? nullptr : __libc_calloc(count, bytes);
}
void* realloc(void* block, std::size_t bytes) { return refuses(bytes) ? nullptr : __libc_realloc(block, bytes); }
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  return refuses(bytes) ? nullptr : __libc_memalign(alignment, bytes);
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  return refuses(bytes) ? nullptr : __libc_memalign(alignment, bytes);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t bytes) {
  *block = refuses(bytes) ? nullptr : __libc_memalign(alignment, bytes);
  return *block == nullptr ? ENOMEM : 0;
}
}
