#include "host_tool/film/attempts.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

namespace nodal::film {
namespace {

namespace fs = std::filesystem;

std::string host_name() {
  std::array<char, 65> host{};
  ::gethostname(host.data(), host.size() - 1);
  return host.data();
}

/// Whether the name has an attempt of this machine in it whose process is gone.
bool is_dead(std::string_view name, const std::string& mark) {
  const std::size_t at = name.find(mark);
  if (at == std::string_view::npos) return false;
  const std::string_view number = name.substr(at + mark.size());
  pid_t pid = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), pid);
  const bool whole = end == number.data() + number.size() || *end == '.';
  return error == std::errc() && whole && pid > 0 && ::kill(pid, 0) != 0 && errno == ESRCH;
}

}  // namespace

std::string attempt_name(const std::string& file) {
  return fmt::format("{}.part-{}-{}", file, host_name(), ::getpid());
}

void remove_dead_attempts(const std::string& file) {
  const fs::path path = file;
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  const std::string begin = path.filename().string();
  const std::string mark = fmt::format(".part-{}-", host_name());
  std::error_code error;
  std::vector<fs::path> dead;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    const std::string name = entry->path().filename().string();
    const bool own = begin.empty() || name.starts_with(begin + mark);
    const bool kind = entry->is_regular_file(unknown) || (entry->is_directory(unknown) && !entry->is_symlink(unknown));
    if (own && is_dead(name, mark) && kind) dead.push_back(entry->path());
  }
  for (const fs::path& left : dead) fs::remove_all(left, error);
}

}  // namespace nodal::film
