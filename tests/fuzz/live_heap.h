// The number of bytes on the program's heap, with and without sanitizers.
#pragma once

#include <cstdint>

namespace nodal::fuzz {

/// Allocated and not yet freed bytes of the whole program. Use only differences: under a sanitizer the count starts at
/// the first call.
///
/// Threading: thread-bound. Errors: none.
std::int64_t live_heap_bytes();

/// Makes malloc keep freed memory for the next input: returning it to the kernel and requesting it again takes a
/// quarter of the time.
void keep_freed_memory();

}  // namespace nodal::fuzz
