// Shared by a test and the preloaded library refuse_memory.cpp: a file that both map.
#pragma once

#include <atomic>
#include <cstdint>

namespace nodal::crash {

inline constexpr const char* kRefusalVariable = "NODAL_TEST_REFUSAL";  ///< environment variable with the file's name
inline constexpr int kThreadName = 16;                                 ///< bytes, as in the kernel

struct Refusal {
  std::atomic<std::uint32_t> on;       ///< 1: refuse from now on
  std::atomic<std::uint32_t> refused;  ///< refused requests so far
  std::uint32_t from_bytes;            ///< smaller requests are granted
  char thread[kThreadName];            ///< only for threads with this name
};

}  // namespace nodal::crash
