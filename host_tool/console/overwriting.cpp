#include "host_tool/console/overwriting.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <filesystem>
#include <mutex>

#include "host_tool/console/files.h"

namespace nodal::host {
namespace {

/// Enough for a command's files with their sidecars; of a million numbered files each is written once.
constexpr std::size_t kRemembered = 16;

struct Rule {
  std::mutex mutex;
  bool overwrites = false;
  std::deque<std::string> own;
};

Rule& rule() {
  static Rule the_rule;
  return the_rule;
}

bool may_replace(const std::string& path) {
  const std::lock_guard guard(rule().mutex);
  return rule().overwrites || std::ranges::find(rule().own, path) != rule().own.end();
}

}  // namespace

Error is_there(const std::string& path) {
  return {Errc::kExists, path + ": is there already, and is not written over; name another file, or --overwrite"};
}

void set_overwriting(bool on) {
  const std::lock_guard guard(rule().mutex);
  rule().overwrites = on;
  rule().own.clear();
}

Status check_free(const std::string& path) {
  struct stat about {};
  if (may_replace(path) || ::stat(path.c_str(), &about) != 0 || !S_ISREG(about.st_mode)) return {};
  return fail(is_there(path));
}

void note_own(const std::string& path) {
  const std::lock_guard guard(rule().mutex);
  std::deque<std::string>& own = rule().own;
  if (std::ranges::find(own, path) != own.end()) return;
  own.push_back(path);
  if (own.size() > kRemembered) own.pop_front();
}

int rename_to_new(const std::string& from, const std::string& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL) return errno;
  // A file system without RENAME_NOREPLACE.
  struct stat about {};
  if (::lstat(to.c_str(), &about) == 0) return EEXIST;
  return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

int rename_to_free(const std::string& from, const std::string& to) {
  if (may_replace(to)) return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
  const int error = rename_to_new(from, to);
  if (error == 0) note_own(to);
  return error;
}

Status check_output(const std::string& out, const std::vector<std::vector<std::string>>& sets, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const Result<std::string> name = numbered_name(out, i);
    if (!name) return fail(name.error().in("--out"));
    for (const auto& set : sets) {
      for (const std::string& picture : set) {
        std::error_code error;
        if (!std::filesystem::equivalent(*name, picture, error)) continue;
        return fail(Errc::kExists, fmt::format("--out: {} is one of the pictures; choose another name", *name));
      }
    }
  }
  return {};
}

}  // namespace nodal::host
