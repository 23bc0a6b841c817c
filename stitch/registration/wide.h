// How loops over many numbers are compiled. Internal to the sources that hold such loops.
#pragma once

// Each loop is compiled once per width of registers and chosen when the program starts. Sanitizers and coverage run
// before that choice can be made, so they get the plain code; the arithmetic is the same, lane for lane.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && !defined(NODAL_COVERAGE)
#define NODAL_WIDE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define NODAL_WIDE
#endif

namespace nodal::registration {

/// Sums are kept in so many parts, whatever the registers' width, so that all add in the same order.
inline constexpr int kLanes = 16;

}  // namespace nodal::registration
