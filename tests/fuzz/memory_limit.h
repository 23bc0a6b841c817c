// A limit for the memory that one input may take, so that a target that takes more fails.
#pragma once

#include <cstddef>

namespace nodal::fuzz {

/// From here on the program has `bytes` of address space more than it has now, and new throws beyond that. Under
/// AddressSanitizer, which takes terabytes of address space for itself, a single block over 256 MiB ends the program
/// instead. Call it once, by the first input.
void limit_memory(std::size_t bytes);

}  // namespace nodal::fuzz
