// How many bytes the program has on its heap, with and without sanitizers.
#pragma once

#include <cstdint>

namespace nodal::fuzz {

/// Bytes that were allocated and not freed, of the whole program. Only differences mean something: under a sanitizer
/// the count begins with the first call.
///
/// Threading: thread-bound. Errors: none.
std::int64_t live_heap_bytes();

/// What is freed stays with the program, whose next input needs it again: asking the kernel each time takes a quarter of
/// the time.
void keep_freed_memory();

}  // namespace nodal::fuzz
