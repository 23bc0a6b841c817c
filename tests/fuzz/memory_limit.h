// Limits the memory that one input may use, so that a target that uses more fails.
#pragma once

#include <cstddef>

namespace nodal::fuzz {

/// From now on the program may use `bytes` more address space than now; beyond that, new throws. Under
/// AddressSanitizer, which itself needs terabytes of address space, a single block over 256 MiB ends the program
/// instead. Call it once, at the first input.
void limit_memory(std::size_t bytes);

}  // namespace nodal::fuzz
