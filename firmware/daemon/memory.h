// How nodald takes memory from the C library, and gives it back: what a calibration needed while its table was compiled
// is not kept for the next one.
#pragma once

#include <string>

namespace nodal::daemon {

/// Blocks of this many bytes or more have pages of their own, which go back with them.
inline constexpr int kLargeBlock = 256 * 1024;

/// The C library reserves 64 MiB of addresses for every arena, and would have one a thread: under `ulimit -v` that is what
/// leaves no room for the threads themselves. Two are enough where the frame path allocates nothing.
inline constexpr int kArenas = 2;

/// Before there are threads.
void keep_large_blocks_apart();
/// What to say when memory or a thread was refused: how much is in use, which limit there is, what to change.
std::string explain_refused_memory();
/// Gives back what small blocks left behind. Takes a few milliseconds, in which other threads may wait for memory.
void give_back_memory();

}  // namespace nodal::daemon
