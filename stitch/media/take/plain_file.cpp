#include "stitch/media/take/plain_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace nodal::media {

Result<PlainFile> PlainFile::open(const std::filesystem::path& path) {
  // O_NONBLOCK: the opening of a named pipe would wait for its other end.
  PlainFile file(path.string(), ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK), 0);
  struct stat about {};
  if (file.fd_ < 0 || ::fstat(file.fd_, &about) != 0 || !S_ISREG(about.st_mode)) {
    return fail(Errc::kNotFound, file.name_ + ": is not there, or not a file");
  }
  file.size_ = static_cast<std::uint64_t>(about.st_size);
  return file;
}

PlainFile::~PlainFile() {
  if (fd_ >= 0) ::close(fd_);
}

PlainFile::PlainFile(PlainFile&& other) noexcept
    : name_(std::move(other.name_)), fd_(std::exchange(other.fd_, -1)), size_(other.size_) {}

PlainFile& PlainFile::operator=(PlainFile&& other) noexcept {
  std::swap(name_, other.name_);
  std::swap(fd_, other.fd_);
  std::swap(size_, other.size_);
  return *this;
}

Status PlainFile::read(std::uint64_t at, std::span<std::uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t got = ::pread(fd_, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      return fail(Errc::kIo, fmt::format("{}: cannot be read at byte {}: {}", name_, at, std::strerror(errno)));
    }
    if (got == 0) return fail(Errc::kTruncated, fmt::format("{}: ends at byte {}", name_, at));
    bytes = bytes.subspan(static_cast<std::size_t>(got));
    at += static_cast<std::uint64_t>(got);
  }
  return {};
}

Result<std::vector<std::uint8_t>> read_plain_file(const std::filesystem::path& path, std::uint64_t limit) {
  const auto file = PlainFile::open(path);
  if (!file) return fail(file.error());
  if (file->size() > limit) {
    return fail(Errc::kTooLarge, fmt::format("{}: {} bytes; at most {}", file->name(), file->size(), limit));
  }
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(file->size()));
  if (const Status read = file->read(0, bytes); !read) return fail(read.error());
  return bytes;
}

}  // namespace nodal::media
