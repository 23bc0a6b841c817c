// How nodald allocates memory from the C library and returns it to the system: the memory that compiling a table needed
// is not kept.
#pragma once

#include <string>

namespace nodal::daemon {

/// Blocks of at least this many bytes get their own pages, which are returned when the block is freed.
inline constexpr int kLargeBlock = 256 * 1024;

/// The C library reserves 64 MiB of addresses for every arena and uses one arena per thread by default; with `ulimit
/// -v` that can leave no addresses for the threads. Two are enough, because the frame path allocates nothing.
inline constexpr int kArenas = 2;

/// Call it before threads are started.
void keep_large_blocks_apart();
/// The message for a refused allocation or thread: how much is in use, which limit applies, what to change.
std::string explain_refused_memory();
/// Returns freed small blocks to the system. Takes a few milliseconds, in which other threads may wait for memory.
void give_back_memory();

}  // namespace nodal::daemon
