// Texts in a driver's answers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace nodal::hal::v4l2 {

/// A text from a driver, which may lack the terminating zero. Its characters are as the driver gave them.
template <std::size_t kSize>
std::string text_of(const std::uint8_t (&field)[kSize]) {
  const char* const start = reinterpret_cast<const char*>(field);
  return std::string(start, ::strnlen(start, kSize));
}

}  // namespace nodal::hal::v4l2
