// Compiles what lies between NODAL_TARGET_BEGIN("avx2") and NODAL_TARGET_END for other instructions than the rest of
// the program, whose headers must all have been included before: what they define stays as it is. And what such kernels
// share.
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

/// What is constant, in such a way that the compiler does not look into it, and so leaves it in memory.
template <class Constants>
[[gnu::always_inline]] inline const Constants& out_of_sight(const Constants& constants) {
  const Constants* at = &constants;
  asm("" : "+r"(at));
  return *at;
}

}  // namespace nodal::blend
