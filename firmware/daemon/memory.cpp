#include "firmware/daemon/memory.h"

#include <malloc.h>

#include <cstddef>
#include <cstdlib>
#include <new>

namespace nodal::daemon {

// Left to itself the C library keeps blocks as large as the largest that was ever freed among the small ones.
void keep_large_blocks_apart() { ::mallopt(M_MMAP_THRESHOLD, kLargeBlock); }

void give_back_memory() { ::malloc_trim(0); }

}  // namespace nodal::daemon

// In place of the standard library's, for the whole program.
void* operator new(std::size_t bytes) {
  constexpr std::size_t kLine = 64;
  const bool large = bytes >= std::size_t{nodal::daemon::kLargeBlock};
  void* const block = large ? std::aligned_alloc(kLine, (bytes + kLine - 1) / kLine * kLine) : std::malloc(bytes);
  if (!block) throw std::bad_alloc();
  return block;
}
void operator delete(void* block) noexcept { std::free(block); }
void operator delete(void* block, std::size_t) noexcept { std::free(block); }
