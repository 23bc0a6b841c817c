#include "host_tool/child/find_program.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "protocol/files/open_file.h"

namespace nodal {

std::string find_program(std::string_view name) {
  const char* const path = std::getenv("PATH");
  const std::string folders = path == nullptr ? "/usr/bin:/bin" : path;
  for (std::size_t from = 0; from <= folders.size();) {
    const std::size_t colon = std::min(folders.find(':', from), folders.size());
    const std::string folder = folders.substr(from, colon - from);
    const std::string file = fmt::format("{}/{}", folder.empty() ? "." : folder, name);
    if (::access(file.c_str(), X_OK) == 0) return file;
    from = colon + 1;
  }
  return "";
}

std::string loader_of(const std::string& program) {
  // The program header of type PT_INTERP of a 64-bit little-endian file (System V ABI, "Program Loading").
  constexpr std::uint32_t kInterpreter = 3;
  const Result<FilePtr> file = open_to_read(program);
  std::array<char, 4096> bytes{};
  if (!file || std::fread(bytes.data(), 1, bytes.size(), file->get()) == 0) return "";
  const auto read = [&](std::size_t at, auto& value) {
    if (at + sizeof value > bytes.size()) return false;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return true;
  };
  if (!std::string_view(bytes.data(), 5).starts_with("\177ELF\2")) return "";
  std::uint64_t table = 0, at = 0;
  std::uint16_t size = 0, count = 0;
  if (!read(32, table) || !read(54, size) || !read(56, count)) return "";
  for (std::uint64_t i = 0; i < count && table < bytes.size(); ++i) {
    std::uint32_t type = 0;
    const std::uint64_t header = table + i * size;
    if (header >= bytes.size() || !read(header, type) || !read(header + 8, at)) return "";
    if (type != kInterpreter || at >= bytes.size()) continue;
    const char* const end = std::find(bytes.data() + at, bytes.data() + bytes.size(), '\0');
    return std::string(bytes.data() + at, static_cast<std::size_t>(end - (bytes.data() + at)));
  }
  return "";
}

}  // namespace nodal
