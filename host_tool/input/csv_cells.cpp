#include "host_tool/input/csv_cells.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <sstream>

namespace nodal::host {

std::vector<std::string> csv_cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) {
    const std::size_t first = cell.find_first_not_of(" \t\""), last = cell.find_last_not_of(" \t\"\r");
    cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
  }
  return cells;
}

Result<double> csv_number(const std::string& cell) {
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value)) {
    return fail(Errc::kBadValue, fmt::format("'{}' is no number", cell));
  }
  return value;
}

}  // namespace nodal::host
