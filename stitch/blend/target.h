// Compiles the code between NODAL_TARGET_BEGIN("avx2") and NODAL_TARGET_END for another instruction set than the rest
// of the program. All headers that other files share must be included before, so that their code is not compiled for
// it. Also a helper that such kernels share.
#pragma once

#define NODAL_PRAGMA(text) _Pragma(#text)
#if defined(__clang__)
#define NODAL_TARGET_BEGIN(instructions) \
  NODAL_PRAGMA(clang attribute push(__attribute__((target(instructions))), apply_to = function))
#define NODAL_TARGET_END _Pragma("clang attribute pop")
#else
#define NODAL_TARGET_BEGIN(instructions) _Pragma("GCC push_options") NODAL_PRAGMA(GCC target(instructions))
#define NODAL_TARGET_END _Pragma("GCC pop_options")
#endif

namespace nodal::blend {

/// Hides from the optimizer that `constants` is constant, so that its values are loaded from memory.
template <class Constants>
[[gnu::always_inline]] inline const Constants& out_of_sight(const Constants& constants) {
  const Constants* at = &constants;
  asm("" : "+r"(at));
  return *at;
}

}  // namespace nodal::blend
