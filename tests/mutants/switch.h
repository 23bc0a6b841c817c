#pragma once

#include <type_traits>

/// Included into every changed source: `on(17) ? changed : original`. NODAL_MUTANT=17 selects change 17; without it,
/// none is on. Constant expressions keep the original.
///
/// Threading: thread-safe; a reached change is only ever marked.
namespace nodal::mutants {

inline constexpr int kMaxChanges = 1 << 14;

extern int selected;                        // 0: none
extern unsigned char reached[kMaxChanges];  // 1: execution came to this change

constexpr bool on(int number) noexcept {
  if (std::is_constant_evaluated()) return false;
  reached[number] = 1;
  return selected == number;
}

}  // namespace nodal::mutants
