#include "host_tool/output/film_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "host_tool/console/overwriting.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::host {

FilmFile::FilmFile(std::string name, int descriptor, bool created)
    : name_(std::move(name)),
      descriptor_(descriptor),
      created_(created),
      film_(name_, [this](auto bytes, auto at) { return write(bytes, at); }) {}

FilmFile::~FilmFile() {
  (void)film_.end();
  ::close(descriptor_);
  if (created_ && !film_.begun()) ::unlink(name_.c_str());
}

Result<std::unique_ptr<FilmFile>> FilmFile::create(const std::string& name) {
  std::error_code unknown;
  const bool created = !std::filesystem::exists(name, unknown);
  NODAL_TRY(check_free(name));
  int descriptor = -1;
  if (created) {
    const Result<FilePtr> made = create_to_write(name);
    if (!made) return fail(made.error().code == Errc::kExists ? is_there(name) : made.error().in(name));
    descriptor = ::fcntl(::fileno(made->get()), F_DUPFD_CLOEXEC, 0);
  } else {
    const Result<int> opened = open_descriptor_to_write(name);
    if (!opened) return fail(opened.error().code, fmt::format("{}: {}", name, opened.error().message));
    descriptor = *opened;
  }
  if (descriptor < 0) return fail(Errc::kIo, fmt::format("{}: {}", name, std::strerror(errno)));
  return std::unique_ptr<FilmFile>(new FilmFile(name, descriptor, created));
}

Status FilmFile::write(std::span<const std::uint8_t> bytes, std::optional<std::uint64_t> at) {
  const auto failed = [this] { return fail(Errc::kIo, fmt::format("{}: {}", name_, std::strerror(errno))); };
  if (!std::exchange(emptied_, true) && ::ftruncate(descriptor_, 0) != 0 && errno != EINVAL) {
    return failed();  // EINVAL: a device or a pipe
  }
  while (!bytes.empty()) {
    const ssize_t n = at ? ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(*at))
                         : ::write(descriptor_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return failed();
    bytes = bytes.subspan(static_cast<std::size_t>(n));
    if (at) *at += static_cast<std::uint64_t>(n);
  }
  return {};
}

}  // namespace nodal::host
