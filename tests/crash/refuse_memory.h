// What a test and the library refuse_memory.cpp, which is preloaded into nodald, share: a file that both map.
#pragma once

#include <atomic>
#include <cstdint>

namespace nodal::crash {

inline constexpr const char* kRefusalVariable = "NODAL_TEST_REFUSAL";  ///< of the environment: the file's name
inline constexpr int kThreadName = 16;                                 ///< bytes, as the kernel has it

struct Refusal {
  std::atomic<std::uint32_t> on;       ///< 1: refuse from now on
  std::atomic<std::uint32_t> refused;  ///< requests so far
  std::uint32_t from_bytes;            ///< smaller requests are granted
  char thread[kThreadName];            ///< only of threads of this name
};

}  // namespace nodal::crash
