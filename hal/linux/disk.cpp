#include "hal/linux/disk.h"

#include <fmt/format.h>

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <limits>

#include "hal/linux/disk_parts.h"
#include "protocol/base/try.h"

namespace nodal::hal::linux_os {
namespace {

/// Readable for owner and group; the umask may remove more.
constexpr mode_t kFileMode = 0640;

}  // namespace

Result<Descriptor> LinuxDisk::open_beneath(const std::string& name, int flags, const char* what) const {
  NODAL_TRY_ASSIGN(const auto root, folder());
  open_how how{};
  how.flags = static_cast<std::uint64_t>(flags | O_CLOEXEC);
  how.mode = (flags & O_CREAT) != 0 ? kFileMode : 0;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS | RESOLVE_NO_MAGICLINKS;
  // EAGAIN: something was renamed during the path walk (openat2(2)).
  for (int attempt = 0;; ++attempt) {
    const long fd = ::syscall(SYS_openat2, root.get(), name.c_str(), &how, sizeof(how));
    if (fd >= 0) return Descriptor(static_cast<int>(fd));
    if ((errno != EINTR && errno != EAGAIN) || attempt == 100) return fail(failure(what, name, errno));
  }
}

Error LinuxDisk::failure(const char* what, const std::string& name, int error) const {
  const std::string path = "file '" + path_ + "/" + name + "': ";
  switch (error) {
    case ENOENT:
    case ENOTDIR: return {Errc::kNotFound, path + "is not there"};
    case ENOSPC:
    case EDQUOT: return {Errc::kDiskFull, path + "the disk is full; make room and try again"};
    case EEXIST:
    case ENOTEMPTY: return {Errc::kExists, path + what + " failed: " + std::strerror(error)};
    case ENODEV:
    case ENXIO: return {Errc::kDeviceGone, path + what + " failed: the disk is gone"};
    case EROFS: return {Errc::kIo, path + what + " failed: the disk is read-only"};
    case EXDEV: return {Errc::kBadValue, path + "leads outside of its folder"};
    case ELOOP: return {Errc::kBadValue, path + "is a symbolic link, or leads through one, which is not followed"};
    default: return {Errc::kIo, path + what + " failed: " + std::strerror(error)};
  }
}

Result<FileHandle> LinuxDisk::open_file(const std::string& name, int flags) {
  NODAL_TRY(check_name(name));
  NODAL_TRY_ASSIGN(auto fd, open_beneath(name, flags | O_NONBLOCK, "opening it"));
  struct stat about {};
  if (::fstat(fd.get(), &about) < 0) return fail(failure("opening it", name, errno));
  const bool to_read = (flags & O_ACCMODE) == O_RDONLY;
  if (!S_ISREG(about.st_mode)) return fail(Errc::kIo, "file '" + path_ + "/" + name + "': is not a file");
  if (!to_read && about.st_nlink > 1) {
    return fail(Errc::kBadValue, "file '" + path_ + "/" + name +
                                     "': has other names, too (hard links), whose bytes would change; copy it");
  }
  const FileHandle handle = next_++;
  files_[handle] = {std::move(fd), name, to_read, static_cast<std::uint64_t>(about.st_size)};
  return handle;
}

Result<LinuxDisk::File*> LinuxDisk::file_of(FileHandle handle, bool to_read) {
  const auto file = files_.find(handle);
  if (file == files_.end()) return fail(Errc::kWrongState, fmt::format("file handle {}: is not open", handle));
  if (file->second.to_read != to_read) {
    return fail(Errc::kWrongState, "file '" + file->second.name + "': is open to be " + (to_read ? "written" : "read") +
                                       ", not to be " + (to_read ? "read" : "written"));
  }
  return &file->second;
}

Result<FileHandle> LinuxDisk::create(const std::string& name) { return open_file(name, O_WRONLY | O_CREAT | O_EXCL); }

Result<FileHandle> LinuxDisk::open_append(const std::string& name) { return open_file(name, O_WRONLY); }

Result<FileHandle> LinuxDisk::open_read(const std::string& name) { return open_file(name, O_RDONLY); }

Result<std::size_t> LinuxDisk::read_at(FileHandle handle, std::uint64_t offset, std::span<std::uint8_t> bytes) {
  NODAL_TRY_ASSIGN(const auto file, file_of(handle, true));
  // off_t limits how large a file can be.
  constexpr std::uint64_t kFarthest = std::numeric_limits<off_t>::max();
  if (offset >= kFarthest) return 0;
  bytes = bytes.first(std::min<std::uint64_t>(bytes.size(), kFarthest - offset));
  std::size_t have = 0;
  while (have < bytes.size()) {
    const ssize_t got = again_when_interrupted([&] {
      return ::pread(file->descriptor.get(), bytes.data() + have, bytes.size() - have,
                     static_cast<off_t>(offset + have));
    });
    if (got < 0) return fail(failure("reading it", file->name, errno));
    if (got == 0) break;
    have += static_cast<std::size_t>(got);
  }
  return have;
}

Status LinuxDisk::write(FileHandle handle, std::span<const std::uint8_t> bytes) {
  return write_pieces(handle, std::span(&bytes, 1));
}

Status LinuxDisk::write_pieces(FileHandle handle, std::span<const std::span<const std::uint8_t>> pieces) {
  NODAL_TRY_ASSIGN(const auto file, file_of(handle, false));
  constexpr std::size_t kMaxPieces = 64;  // pieces per call of writev(); the system's limit is 1024
  std::array<iovec, kMaxPieces> parts{};
  std::size_t done = 0;  // bytes of pieces.front()
  while (!pieces.empty()) {
    std::size_t count = 0;
    for (; count < std::min(pieces.size(), kMaxPieces); ++count) {
      const auto rest = pieces[count].subspan(count == 0 ? done : 0);
      parts[count] = {const_cast<std::uint8_t*>(rest.data()), rest.size()};
    }
    // O_APPEND is not used, because with it pwrite() appends too. Appending is at the known end.
    const ssize_t put = again_when_interrupted([&] {
      return ::pwritev(file->descriptor.get(), parts.data(), static_cast<int>(count), static_cast<off_t>(file->end));
    });
    if (put < 0) return fail(failure("writing it", file->name, errno));
    file->end += static_cast<std::uint64_t>(put);
    done += static_cast<std::size_t>(put);
    while (!pieces.empty() && done >= pieces.front().size()) {
      done -= pieces.front().size();
      pieces = pieces.subspan(1);
    }
  }
  return {};
}

Status LinuxDisk::overwrite(FileHandle handle, std::uint64_t offset, std::span<const std::uint8_t> bytes) {
  NODAL_TRY_ASSIGN(const auto file, file_of(handle, false));
  if (bytes.empty()) return {};
  if (offset > file->end || bytes.size() > file->end - offset ||
      offset / kSector != (offset + bytes.size() - 1) / kSector) {
    return fail(Errc::kBadValue, "file '" + path_ + "/" + file->name + "': only bytes of one sector are replaced");
  }
  while (!bytes.empty()) {
    const ssize_t put = again_when_interrupted(
        [&] { return ::pwrite(file->descriptor.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset)); });
    if (put < 0) return fail(failure("writing it", file->name, errno));
    offset += static_cast<std::uint64_t>(put);
    bytes = bytes.subspan(static_cast<std::size_t>(put));
  }
  return {};
}

Status LinuxDisk::truncate(FileHandle handle, std::uint64_t size) {
  NODAL_TRY_ASSIGN(const auto file, file_of(handle, false));
  if (size > file->end) {
    return fail(Errc::kBadValue, fmt::format("file '{}/{}': is shorter than {}", path_, file->name, size));
  }
  if (again_when_interrupted([&] { return ::ftruncate(file->descriptor.get(), static_cast<off_t>(size)); }) < 0) {
    return fail(failure("shortening it", file->name, errno));
  }
  file->end = size;
  return {};
}

void LinuxDisk::start_write_out(FileHandle handle) {
  const auto file = file_of(handle, false);
  if (!file) return;
  (void)::sync_file_range((*file)->descriptor.get(), 0, 0, SYNC_FILE_RANGE_WRITE);
  // Memory that goes back to the kernel is used again for the next bytes, instead of the memory of everything else on
  // the board.
  const std::uint64_t begin = (*file)->let_go, end = (*file)->end;
  if (end < begin + 2 * kKeptInMemory) return;
  (*file)->let_go = end - kKeptInMemory;
  (void)::posix_fadvise((*file)->descriptor.get(), static_cast<off_t>(begin),
                        static_cast<off_t>((*file)->let_go - begin), POSIX_FADV_DONTNEED);
}

void LinuxDisk::preallocate(FileHandle handle, std::uint64_t bytes) {
  const auto file = file_of(handle, false);
  const auto length = static_cast<off_t>(bytes);
  if (file) (void)::fallocate((*file)->descriptor.get(), FALLOC_FL_KEEP_SIZE, static_cast<off_t>((*file)->end), length);
}

Status LinuxDisk::sync_all() {
  NODAL_TRY_ASSIGN(const auto root, folder());
  if (again_when_interrupted([&] { return ::syncfs(root.get()); }) < 0) return fail(failure("syncing all", "", errno));
  return {};
}

Status LinuxDisk::sync(FileHandle handle) {
  const auto file = files_.find(handle);
  if (file == files_.end()) return fail(Errc::kWrongState, fmt::format("file handle {}: is not open", handle));
  if (again_when_interrupted([&] { return ::fsync(file->second.descriptor.get()); }) < 0) {
    return fail(failure("syncing it", file->second.name, errno));
  }
  return {};
}

void LinuxDisk::close(FileHandle handle) { files_.erase(handle); }

Result<std::vector<std::uint8_t>> LinuxDisk::read(const std::string& name, std::uint64_t limit_bytes) {
  NODAL_TRY(check_name(name));
  NODAL_TRY_ASSIGN(const auto fd, open_beneath(name, O_RDONLY | O_NONBLOCK, "opening it"));
  struct stat about {};
  if (::fstat(fd.get(), &about) < 0) return fail(failure("reading it", name, errno));
  if (!S_ISREG(about.st_mode)) return fail(Errc::kIo, "file '" + path_ + "/" + name + "': is not a file");
  std::vector<std::uint8_t> bytes;
  // Requests one byte more than the limit, so that a file that grows meanwhile is detected too.
  const auto length = static_cast<std::uint64_t>(about.st_size);
  if (length <= limit_bytes) {
    bytes.resize(static_cast<std::size_t>(std::min(length, limit_bytes) + 1));
    std::size_t have = 0;
    for (;;) {
      const ssize_t got =
          again_when_interrupted([&] { return ::read(fd.get(), bytes.data() + have, bytes.size() - have); });
      if (got < 0) return fail(failure("reading it", name, errno));
      if (got == 0) break;
      have += static_cast<std::size_t>(got);
      if (have > limit_bytes) break;
      if (have == bytes.size()) bytes.resize(2 * bytes.size());
    }
    bytes.resize(have);
  }
  if (length > limit_bytes || bytes.size() > limit_bytes) {
    return fail(Errc::kTooLarge, fmt::format("file '{}/{}': is {} bytes, over the limit of {}", path_, name,
                                             std::max<std::uint64_t>(length, bytes.size()), limit_bytes));
  }
  return bytes;
}

Result<std::uint64_t> LinuxDisk::size(const std::string& name) {
  NODAL_TRY(check_name(name));
  NODAL_TRY_ASSIGN(const auto fd, open_beneath(name, O_PATH, "opening it"));
  struct stat about {};
  if (::fstat(fd.get(), &about) < 0) return fail(failure("reading it", name, errno));
  if (!S_ISREG(about.st_mode)) return fail(Errc::kIo, "file '" + path_ + "/" + name + "': is not a file");
  return static_cast<std::uint64_t>(about.st_size);
}

}  // namespace nodal::hal::linux_os
