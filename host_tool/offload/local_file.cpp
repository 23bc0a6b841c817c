#include "host_tool/offload/local_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "host_tool/console/overwriting.h"

namespace nodal::host {
namespace {

Errc code_of(int error) {
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) return Errc::kDiskFull;
  return error == ENOENT ? Errc::kNotFound : Errc::kIo;
}

tl::unexpected<Error> refuse(const std::filesystem::path& path, const char* what, int error) {
  return fail(code_of(error), fmt::format("{}: {}: {}", path.string(), what, std::strerror(error)));
}

}  // namespace

LocalFile::LocalFile(int fd, std::filesystem::path path) : fd_(fd), path_(std::move(path)) {}
LocalFile::LocalFile(LocalFile&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), path_(std::move(other.path_)), let_go_(other.let_go_) {}
LocalFile::~LocalFile() {
  if (fd_ >= 0) ::close(fd_);
}

Result<LocalFile> LocalFile::open_to_write(const std::filesystem::path& path) { return open(path, O_RDWR | O_CREAT); }
Result<LocalFile> LocalFile::open_to_read(const std::filesystem::path& path) { return open(path, O_RDONLY); }

Result<LocalFile> LocalFile::open(const std::filesystem::path& path, int flags) {
  const int fd = ::open(path.c_str(), flags | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
  if (fd < 0) return refuse(path, "cannot be opened", errno);
  LocalFile file(fd, path);
  struct stat about {};
  if (::fstat(fd, &about) != 0) return refuse(path, "cannot be read", errno);
  if (!S_ISREG(about.st_mode)) return fail(Errc::kIo, path.string() + ": is not a regular file");
  if ((flags & O_CREAT) != 0 && about.st_nlink > 1) {
    return fail(Errc::kIo, path.string() + ": has other names, too (hard links), whose bytes would change; remove it");
  }
  return file;
}

tl::unexpected<Error> LocalFile::failed(const char* what, int error) const { return refuse(path_, what, error); }

Result<std::uint64_t> LocalFile::size() const {
  struct stat about {};
  if (::fstat(fd_, &about) != 0) return failed("cannot be read", errno);
  return static_cast<std::uint64_t>(about.st_size);
}

Result<std::size_t> LocalFile::read(std::uint64_t offset, std::span<std::uint8_t> bytes) const {
  std::size_t have = 0;
  while (have < bytes.size()) {
    const ssize_t got = ::pread(fd_, bytes.data() + have, bytes.size() - have, static_cast<off_t>(offset + have));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return failed("cannot be read", errno);
    if (got == 0) break;
    have += static_cast<std::size_t>(got);
  }
  return have;
}

Status LocalFile::write(std::uint64_t offset, std::span<const std::uint8_t> bytes) {
  const std::uint64_t from = offset;
  while (!bytes.empty()) {
    const ssize_t wrote = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) return failed("cannot be written", errno);
    offset += static_cast<std::uint64_t>(wrote);
    bytes = bytes.subspan(static_cast<std::size_t>(wrote));
  }
  // The disk begins now, so that sync() has less to wait for.
  (void)::sync_file_range(fd_, static_cast<off_t>(from), static_cast<off_t>(offset - from), SYNC_FILE_RANGE_WRITE);
  // Memory of what is on the disk is used again for the next bytes: faster than new memory, and other programs keep
  // theirs.
  constexpr std::uint64_t kKept = std::uint64_t{16} << 20;
  if (from >= let_go_ + 2 * kKept) {
    const std::uint64_t begin = std::exchange(let_go_, from - kKept);
    (void)::posix_fadvise(fd_, static_cast<off_t>(begin), static_cast<off_t>(let_go_ - begin), POSIX_FADV_DONTNEED);
  }
  return {};
}

Status LocalFile::truncate(std::uint64_t size) {
  if (::ftruncate(fd_, static_cast<off_t>(size)) != 0) return failed("cannot be shortened", errno);
  return {};
}

Status LocalFile::sync() {
  if (::fsync(fd_) != 0) return failed("cannot be written to the disk", errno);
  return {};
}

Status sync_folder(const std::filesystem::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return refuse(folder, "cannot be opened", errno);
  const int done = ::fsync(fd) == 0 ? 0 : errno;
  ::close(fd);
  // A file system that cannot sync folders says so by these.
  if (done != 0 && done != EINVAL && done != ENOTSUP) return refuse(folder, "cannot be written to the disk", done);
  return {};
}

Status rename_new(const std::filesystem::path& from, const std::filesystem::path& to) {
  const int error = rename_to_new(from.string(), to.string());
  if (error == EEXIST)
    return fail(Errc::kExists, to.string() + ": is there already, and is never written over; move it away");
  if (error != 0) return refuse(to, "cannot be written", error);
  return {};
}

Result<FolderLock> FolderLock::take(const std::filesystem::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) return refuse(folder, "cannot be opened", errno);
  FolderLock lock(fd);
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    return fail(Errc::kBusy, folder.string() + ": another nodal copies to it; wait for it, or use another folder");
  }
  return lock;
}

FolderLock::FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

Result<std::uint64_t> free_bytes(const std::filesystem::path& folder) {
  struct statvfs about {};
  if (::statvfs(folder.c_str(), &about) != 0) return refuse(folder, "cannot be read", errno);
  return std::uint64_t{about.f_bavail} * about.f_frsize;
}

std::optional<std::uint64_t> length_of_file(const std::filesystem::path& path) {
  struct stat about {};
  if (::lstat(path.c_str(), &about) != 0 || !S_ISREG(about.st_mode)) return std::nullopt;
  return static_cast<std::uint64_t>(about.st_size);
}

}  // namespace nodal::host
