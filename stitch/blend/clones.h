// Functions that are also compiled for AVX2; the loader selects the version. For integer arithmetic, where both give
// the same bytes.
#pragma once

#ifdef __x86_64__
#define NODAL_CLONES [[gnu::target_clones("default", "avx2")]]
#else
#define NODAL_CLONES
#endif
