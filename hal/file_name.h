#pragma once

#include <algorithm>
#include <string_view>

namespace nodal::hal {

/// Whether a DiskPort accepts the name: parts with '/' between, none of them empty, "." or "..".
inline bool is_file_name(std::string_view name) {
  if (name.empty() || name.find('\0') != std::string_view::npos) return false;
  for (std::size_t from = 0; from <= name.size();) {
    const std::size_t slash = std::min(name.find('/', from), name.size());
    const std::string_view part = name.substr(from, slash - from);
    if (part.empty() || part == "." || part == "..") return false;
    from = slash + 1;
  }
  return true;
}

}  // namespace nodal::hal
