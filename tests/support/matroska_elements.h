// The elements of a Matroska file, read as RFC 8794 says.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace nodal::test {

struct Element {
  std::uint64_t id = 0, at = 0, content = 0, size = 0;  ///< positions in the file
};

/// The element at `at`, if it is complete within `end`; a length of all ones is "to the end".
inline std::optional<Element> element_at(std::span<const std::uint8_t> file, std::uint64_t at, std::uint64_t end) {
  const auto number = [&](bool with_marker) -> std::optional<std::uint64_t> {
    if (at >= end) return std::nullopt;
    int bytes = 1;
    while (bytes <= 8 && (file[at] & (0x100 >> bytes)) == 0) ++bytes;
    if (bytes > 8 || at + static_cast<std::uint64_t>(bytes) > end) return std::nullopt;
    std::uint64_t value = 0;
    for (int k = 0; k < bytes; ++k) value = value << 8 | file[at++];
    const std::uint64_t marker = std::uint64_t{1} << (7 * bytes);
    if (with_marker) return value;
    return value - marker == marker - 1 ? UINT64_MAX : value - marker;
  };
  Element element;
  element.at = at;
  const auto id = number(true);
  const auto size = id ? number(false) : std::nullopt;
  if (!size) return std::nullopt;
  element.id = *id;
  element.content = at;
  element.size = *size == UINT64_MAX ? end - at : *size;
  if (element.size > end - at) return std::nullopt;
  return element;
}

inline std::vector<Element> children(std::span<const std::uint8_t> file, const Element& of) {
  std::vector<Element> all;
  for (std::uint64_t at = of.content; const auto element = element_at(file, at, of.content + of.size);) {
    all.push_back(*element);
    at = element->content + element->size;
  }
  return all;
}

inline std::uint64_t value_of(std::span<const std::uint8_t> file, const Element& element) {
  std::uint64_t value = 0;
  for (std::uint64_t k = 0; k < element.size; ++k) value = value << 8 | file[element.content + k];
  return value;
}

inline std::optional<Element> child(std::span<const std::uint8_t> file, const Element& of, std::uint64_t id) {
  for (const Element& each : children(file, of)) {
    if (each.id == id) return each;
  }
  return std::nullopt;
}

}  // namespace nodal::test
