#include "host_tool/console/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <utility>

#include "host_tool/console/overwriting.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::host {
namespace {

tl::unexpected<Error> system_error(const std::string& path, int number) {
  switch (number) {
    case ENOSPC:
    case EDQUOT: return fail(Errc::kDiskFull, path + ": the disk is full; make room, or write elsewhere with --out");
    case ENOENT: return fail(Errc::kNotFound, path + ": there is no such file or folder");
    default: return fail(Errc::kIo, fmt::format("{}: {}", path, std::strerror(number)));
  }
}

tl::unexpected<Error> not_opened(const std::string& path, const Error& error) {
  return error.code == Errc::kNotFound ? system_error(path, ENOENT) : fail(error.in(path));
}

/// A descriptor that is closed at the end of its scope.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  /// Returns 0 or an errno: some file systems report a full disk only at close.
  int close() { return ::close(std::exchange(fd_, -1)) == 0 ? 0 : errno; }

 private:
  int fd_;
};

int write_all(int fd, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno != EINTR) return errno;
    if (written > 0) bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

/// Returns 0 or an errno; that a file system cannot sync (EINVAL, ENOTSUP) is not an error for the user.
int sync(int fd) { return ::fsync(fd) == 0 || errno == EINVAL || errno == ENOTSUP ? 0 : errno; }

/// Whether the file, of which `info` was read, has these very bytes: then nothing needs to be written over.
bool has_bytes(const std::string& path, const struct stat& info, std::span<const std::uint8_t> bytes) {
  if (!S_ISREG(info.st_mode) || static_cast<std::uint64_t>(info.st_size) != bytes.size()) return false;
  const Result<std::string> existing = read_file(path, bytes.size());
  return existing && std::equal(existing->begin(), existing->end(), bytes.begin(), bytes.end(),
                                [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
}

/// The umask can only be read by setting it; no other thread creates files meanwhile.
mode_t current_umask() {
  const mode_t mask = ::umask(0);
  ::umask(mask);
  return mask;
}

/// The position of "%d" or "%0Nd" in a pattern.
struct Conversion {
  std::size_t at = 0;
  std::size_t length = 0;
  int digits = 0;
};

Result<std::optional<Conversion>> find_conversion(const std::string& pattern) {
  std::optional<Conversion> found;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (pattern[i] != '%') continue;
    if (i + 1 < pattern.size() && pattern[i + 1] == '%') {
      ++i;
      continue;
    }
    std::size_t end = i + 1;
    while (end < pattern.size() && pattern[end] >= '0' && pattern[end] <= '9') ++end;
    const std::string width = pattern.substr(i + 1, end - i - 1);
    if (end == pattern.size() || pattern[end] != 'd' || width.size() > 2 || found) {
      return fail(Errc::kBadValue, fmt::format("file name '{}': it may hold one %d or %06d for the number, and %% for "
                                               "a percent sign",
                                               pattern));
    }
    found = Conversion{i, end + 1 - i, width.empty() ? 1 : std::atoi(width.c_str())};
    i = end;
  }
  return found;
}

std::string unescaped(std::string text) {
  for (std::size_t i = 0; (i = text.find("%%", i)) != std::string::npos; ++i) text.erase(i, 1);
  return text;
}

}  // namespace

Result<std::string> read_file(const std::string& path, std::size_t limit) {
  const Result<int> opened = open_descriptor_to_read(path);
  if (!opened) return not_opened(path, opened.error());
  const Descriptor file(*opened);
  std::string content;
  char buffer[65536];
  while (true) {
    const ssize_t got = ::read(file.get(), buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return system_error(path, errno);
    if (got == 0) return content;
    content.append(buffer, static_cast<std::size_t>(got));
    if (content.size() > limit) {
      return fail(Errc::kTooLarge, fmt::format("{}: over {} bytes; is it the right file?", path, limit));
    }
  }
}

Status write_file(const std::string& path, std::span<const std::uint8_t> bytes, Durability durability) {
  // A file that is not regular (/dev/null, a pipe) cannot be replaced, so it is written in place.
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode)) {
    if (S_ISDIR(info.st_mode)) return system_error(path, EISDIR);
    const Result<int> opened = open_descriptor_to_write(path);
    if (!opened) return not_opened(path, opened.error());
    Descriptor device(*opened);
    int wrong = write_all(device.get(), bytes);
    if (const int at_close = device.close(); wrong == 0) wrong = at_close;
    return wrong == 0 ? Status{} : system_error(path, wrong);
  }
  if (has_bytes(path, info, bytes)) return {};
  NODAL_TRY(check_free(path));
  std::string temporary = path + ".XXXXXX";
  Descriptor file(::mkstemp(temporary.data()));
  if (file.get() < 0) return system_error(path, errno);
  int wrong = write_all(file.get(), bytes);
  if (wrong == 0 && ::fchmod(file.get(), 0666 & ~current_umask()) != 0) wrong = errno;
  if (wrong == 0 && durability == Durability::kNow) wrong = sync(file.get());
  if (const int at_close = file.close(); wrong == 0) wrong = at_close;
  if (wrong == 0) wrong = rename_to_free(temporary, path);
  if (wrong == 0) return {};
  ::unlink(temporary.c_str());
  if (wrong == EEXIST) return fail(is_there(path));
  return system_error(path, wrong);
}

Status write_file(const std::string& path, std::string_view text) {
  return write_file(path, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

Result<std::string> numbered_name(const std::string& pattern, std::uint64_t number) {
  NODAL_TRY_ASSIGN(const std::optional<Conversion> conversion, find_conversion(pattern));
  if (!conversion) return unescaped(pattern);
  const Conversion& at = *conversion;
  return unescaped(pattern.substr(0, at.at)) + fmt::format("{:0{}}", number, at.digits) +
         unescaped(pattern.substr(at.at + at.length));
}

bool has_number(const std::string& pattern) {
  const Result<std::optional<Conversion>> conversion = find_conversion(pattern);
  return conversion && conversion->has_value();
}

}  // namespace nodal::host
