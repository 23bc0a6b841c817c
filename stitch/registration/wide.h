// How vectorized loops are compiled. Internal to the sources that contain such loops.
#pragma once

// Each loop is compiled once per register width, and the loader selects a version. Builds with sanitizers or coverage
// use the plain code, because their own code runs before the selection; the arithmetic is the same, lane for lane.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && !defined(NODAL_COVERAGE)
#define NODAL_WIDE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define NODAL_WIDE
#endif

namespace nodal::registration {

/// Number of partial sums, independent of the register width, so that all versions add in the same order.
inline constexpr int kLanes = 16;

}  // namespace nodal::registration
