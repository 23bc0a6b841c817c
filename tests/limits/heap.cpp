#include "heap.h"

#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cerrno>

namespace nodal::limits {
namespace {

constexpr std::size_t kBlockHeader = 8;  // bytes that glibc's malloc() puts before a block

std::atomic<std::size_t> heap_now{0}, heap_most{0};

}  // namespace

std::size_t peak_of(const std::function<void()>& work) {
  const std::size_t before = heap_now.load();
  heap_most.store(before);
  work();
  return heap_most.load() - before;
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
namespace {

void* counted(void* block) {
  if (!block) return block;
  const std::size_t bytes = ::malloc_usable_size(block) + kBlockHeader;
  const std::size_t all = heap_now.fetch_add(bytes) + bytes;
  for (std::size_t seen = heap_most.load(); all > seen && !heap_most.compare_exchange_weak(seen, all);) {}
  return block;
}

void uncounted(void* block) {
  if (block) heap_now.fetch_sub(::malloc_usable_size(block) + kBlockHeader);
}

}  // namespace
#endif

}  // namespace nodal::limits

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// glibc lets a program replace these functions, and keeps its own under these names.
extern "C" {

void* __libc_malloc(std::size_t bytes);
void* __libc_calloc(std::size_t count, std::size_t bytes);
void* __libc_realloc(void* block, std::size_t bytes);
void* __libc_memalign(std::size_t alignment, std::size_t bytes);
void __libc_free(void* block);

void* malloc(std::size_t bytes) { return nodal::limits::counted(__libc_malloc(bytes)); }
void* calloc(std::size_t count, std::size_t bytes) { return nodal::limits::counted(__libc_calloc(count, bytes)); }
void* realloc(void* block, std::size_t bytes) {
  // While it copies there are two blocks at most, of which the old one is counted until the new one is.
  const std::size_t old = block ? ::malloc_usable_size(block) + nodal::limits::kBlockHeader : 0;
  void* const moved = nodal::limits::counted(__libc_realloc(block, bytes));
  if (moved || bytes == 0) nodal::limits::heap_now.fetch_sub(old);
  return moved;
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  return nodal::limits::counted(__libc_memalign(alignment, bytes));
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) { return memalign(alignment, bytes); }
int posix_memalign(void** block, std::size_t alignment, std::size_t bytes) {
  *block = memalign(alignment, bytes);
  return *block ? 0 : ENOMEM;
}
void free(void* block) {
  nodal::limits::uncounted(block);
  __libc_free(block);
}

}  // extern "C"
#endif
