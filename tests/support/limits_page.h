// The column "memory at the limit" of protocol/LIMITS.md.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>

namespace nodal::test {

struct LimitsFigure {
  std::uint64_t bytes = 0;  ///< or how many, if it
  bool counts = false;      ///< counts pictures
  std::string means;        ///< the word in parentheses: "heap", "sizes", "addresses"
};

/// "64 KiB of each host (heap)", "4 sets of all heads (sizes)". Nothing for another text, such as "none".
inline std::optional<LimitsFigure> limits_figure(const std::string& cell) {
  char* rest = nullptr;
  const std::uint64_t amount = std::strtoull(cell.c_str(), &rest, 10);
  if (rest == cell.c_str()) return std::nullopt;
  while (*rest == ' ') ++rest;
  const std::string text = rest;
  const std::size_t open = text.rfind('('), close = text.rfind(')');
  if (open == std::string::npos || close == std::string::npos || close < open) return std::nullopt;
  const std::string unit = text.substr(0, text.find_first_of(" ,;"));
  const bool counts = unit == "raymaps" || unit == "sets";
  const std::uint64_t scale = unit == "KiB" ? 1 << 10 : unit == "MiB" ? 1 << 20 : counts || unit == "bytes" ? 1 : 0;
  if (scale == 0) return std::nullopt;
  return LimitsFigure{amount * scale, counts, text.substr(open + 1, close - open - 1)};
}

/// The figure of the row with this first cell; the third cell has it. Nothing if there is no such row, or it has none.
inline std::optional<LimitsFigure> figure_on_page(const std::string& checkout, const std::string& what) {
  std::ifstream page(checkout + "/protocol/LIMITS.md");
  for (std::string line; std::getline(page, line);) {
    if (!line.starts_with("| " + what + " |")) continue;
    std::size_t begin = 0;
    for (int k = 0; k < 3; ++k) begin = line.find('|', begin) + 1;
    return limits_figure(line.substr(begin, line.find('|', begin) - begin));
  }
  return std::nullopt;
}

/// MiB that the page gives to a row whose memory is limited by a process's addresses; 0 if there is none.
inline std::uint64_t memory_on_page(const std::string& checkout, const std::string& what) {
  const auto figure = figure_on_page(checkout, what);
  return figure && figure->means == "addresses" ? figure->bytes >> 20 : 0;
}

}  // namespace nodal::test
