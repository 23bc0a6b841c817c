#include "tests/fuzz/live_heap.h"

#include <malloc.h>

#include <cstddef>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define NODAL_SANITIZER_HEAP 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define NODAL_SANITIZER_HEAP 1
#endif
#endif

#ifdef NODAL_SANITIZER_HEAP
#include <sanitizer/allocator_interface.h>
#endif

namespace nodal::fuzz {

void keep_freed_memory() {
  constexpr int kEnough = 32 << 20;  // the largest block that is not returned
  (void)mallopt(M_TRIM_THRESHOLD, kEnough);
  (void)mallopt(M_MMAP_THRESHOLD, kEnough);
}

#ifdef NODAL_SANITIZER_HEAP
// mallinfo2() does not know a sanitizer's allocator, whose own figure includes its quarantine.
namespace {

std::int64_t live = 0;

void on_malloc(const volatile void*, std::size_t bytes) { live += static_cast<std::int64_t>(bytes); }
void on_free(const volatile void* block) {
  if (block) live -= static_cast<std::int64_t>(__sanitizer_get_allocated_size(const_cast<const void*>(block)));
}

}  // namespace

std::int64_t live_heap_bytes() {
  static const int installed = __sanitizer_install_malloc_and_free_hooks(on_malloc, on_free);
  return installed != 0 ? live : 0;
}
#else
std::int64_t live_heap_bytes() {
  const struct mallinfo2 now = mallinfo2();
  return static_cast<std::int64_t>(now.uordblks + now.hblkhd);
}
#endif

}  // namespace nodal::fuzz
