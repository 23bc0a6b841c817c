// A scene without edges, whose colours follow from a formula.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace nodal::command_line {

/// A smooth scene: red, green and blue rise to the right, down and forward, with waves.
inline std::array<std::uint8_t, 3> scene_at(const std::array<double, 3>& ray) {
  std::array<std::uint8_t, 3> colour{};
  for (std::size_t c = 0; c < 3; ++c)
    colour[c] = static_cast<std::uint8_t>(128 + 70 * ray[c] + 40 * std::sin(5 * ray[(c + 1) % 3] + 1));
  return colour;
}

}  // namespace nodal::command_line
