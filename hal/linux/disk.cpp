#include "hal/linux/disk.h"

#include <dirent.h>
#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <limits>

#include "hal/file_name.h"

namespace nodal::hal::linux_os {
namespace {

// Readable for owner and group; the umask may remove more.
constexpr mode_t kFileMode = 0640;
constexpr mode_t kFolderMode = 0750;

/// A descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }
  explicit operator bool() const { return fd_ >= 0; }

 private:
  int fd_;
};

Status check(const std::string& name) {
  if (is_file_name(name)) return {};
  return fail(Errc::kBadValue, "file '" + name + "': a name is parts with '/' between, never '..', '.' or empty ones");
}

std::string folder_of(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? "." : name.substr(0, slash);
}
const char* last_part(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return name.c_str() + (slash == std::string::npos ? 0 : slash + 1);
}

template <class Call>
auto again_when_interrupted(Call call) {
  for (;;) {
    const auto result = call();
    if (result >= 0 || errno != EINTR) return result;
  }
}

}  // namespace

Result<std::unique_ptr<LinuxDisk>> LinuxDisk::open(const std::string& root) {
  std::error_code error;
  std::filesystem::create_directories(root, error);
  if (error) return fail(Errc::kIo, "folder '" + root + "': cannot be made: " + error.message());
  const int fd = ::open(root.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return fail(Errc::kIo, "folder '" + root + "': cannot be opened: " + std::strerror(errno));
  return std::unique_ptr<LinuxDisk>(new LinuxDisk(fd, root));
}

LinuxDisk::~LinuxDisk() {
  for (const auto& [handle, file] : files_) ::close(file.descriptor);
  ::close(root_);
}

int LinuxDisk::open_beneath(const std::string& name, int flags) const {
  open_how how{};
  how.flags = static_cast<std::uint64_t>(flags | O_CLOEXEC);
  how.mode = (flags & O_CREAT) != 0 ? kFileMode : 0;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_MAGICLINKS;
  // EAGAIN: something was renamed during the path walk (openat2(2)).
  for (int attempt = 0;; ++attempt) {
    const long fd = ::syscall(SYS_openat2, root_, name.c_str(), &how, sizeof(how));
    if (fd >= 0 || (errno != EINTR && errno != EAGAIN) || attempt == 100) return static_cast<int>(fd);
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
    case EXDEV:
    case ELOOP: return {Errc::kBadValue, path + "leads outside of its folder"};
    default: return {Errc::kIo, path + what + " failed: " + std::strerror(error)};
  }
}

Result<FileHandle> LinuxDisk::open_file(const std::string& name, int flags) {
  if (auto checked = check(name); !checked) return fail(checked.error());
  const int fd = open_beneath(name, flags);
  if (fd < 0)
    return fail(errno == EISDIR ? Error{Errc::kExists, "file '" + name + "': is a folder"}
                                : failure("opening it", name, errno));
  const bool to_read = (flags & O_ACCMODE) == O_RDONLY;
  struct stat about {};
  const int error = ::fstat(fd, &about) < 0 ? errno : 0;
  if (error != 0 || (to_read && !S_ISREG(about.st_mode))) {
    ::close(fd);
    if (error != 0) return fail(failure("opening it", name, error));
    return fail(Errc::kIo, "file '" + path_ + "/" + name + "': is not a file");
  }
  const FileHandle handle = next_++;
  files_[handle] = {fd, name, to_read, static_cast<std::uint64_t>(about.st_size)};
  return handle;
}

Result<LinuxDisk::File*> LinuxDisk::file_of(FileHandle handle, bool to_read) {
  const auto file = files_.find(handle);
  if (file == files_.end()) return fail(Errc::kWrongState, "file handle " + std::to_string(handle) + ": is not open");
  if (file->second.to_read != to_read) {
    return fail(Errc::kWrongState, "file '" + file->second.name + "': is open to be " + (to_read ? "written" : "read") +
                                       ", not to be " + (to_read ? "read" : "written"));
  }
  return &file->second;
}

Result<FileHandle> LinuxDisk::create(const std::string& name) { return open_file(name, O_WRONLY | O_CREAT | O_TRUNC); }

Result<FileHandle> LinuxDisk::open_append(const std::string& name) { return open_file(name, O_WRONLY); }

Result<FileHandle> LinuxDisk::open_read(const std::string& name) {
  return open_file(name, O_RDONLY | O_NONBLOCK);  // opening a FIFO would wait for its other end
}

Result<std::size_t> LinuxDisk::read_at(FileHandle handle, std::uint64_t offset, std::span<std::uint8_t> bytes) {
  const auto file = file_of(handle, true);
  if (!file) return fail(file.error());
  // off_t limits how large a file can be.
  constexpr std::uint64_t kFarthest = std::numeric_limits<off_t>::max();
  if (offset >= kFarthest) return 0;
  bytes = bytes.first(std::min<std::uint64_t>(bytes.size(), kFarthest - offset));
  std::size_t have = 0;
  while (have < bytes.size()) {
    const ssize_t got = again_when_interrupted([&] {
      return ::pread((*file)->descriptor, bytes.data() + have, bytes.size() - have, static_cast<off_t>(offset + have));
    });
    if (got < 0) return fail(failure("reading it", (*file)->name, errno));
    if (got == 0) break;
    have += static_cast<std::size_t>(got);
  }
  return have;
}

Status LinuxDisk::write(FileHandle handle, std::span<const std::uint8_t> bytes) {
  return write_pieces(handle, std::span(&bytes, 1));
}

Status LinuxDisk::write_pieces(FileHandle handle, std::span<const std::span<const std::uint8_t>> pieces) {
  const auto file = file_of(handle, false);
  if (!file) return fail(file.error());
  constexpr std::size_t kMostPieces = 64;  // of one call; the system's limit is 1024
  std::array<iovec, kMostPieces> parts{};
  std::size_t done = 0;  // bytes of pieces.front()
  while (!pieces.empty()) {
    std::size_t count = 0;
    for (; count < std::min(pieces.size(), kMostPieces); ++count) {
      const auto rest = pieces[count].subspan(count == 0 ? done : 0);
      parts[count] = {const_cast<std::uint8_t*>(rest.data()), rest.size()};
    }
    // O_APPEND is not used, because with it pwrite() appends too. Appending is at the known end.
    const ssize_t put = again_when_interrupted([&] {
      return ::pwritev((*file)->descriptor, parts.data(), static_cast<int>(count), static_cast<off_t>((*file)->end));
    });
    if (put < 0) return fail(failure("writing it", (*file)->name, errno));
    (*file)->end += static_cast<std::uint64_t>(put);
    done += static_cast<std::size_t>(put);
    while (!pieces.empty() && done >= pieces.front().size()) {
      done -= pieces.front().size();
      pieces = pieces.subspan(1);
    }
  }
  return {};
}

Status LinuxDisk::overwrite(FileHandle handle, std::uint64_t offset, std::span<const std::uint8_t> bytes) {
  const auto file = file_of(handle, false);
  if (!file) return fail(file.error());
  if (bytes.empty()) return {};
  if (offset > (*file)->end || bytes.size() > (*file)->end - offset ||
      offset / kSector != (offset + bytes.size() - 1) / kSector) {
    return fail(Errc::kBadValue, "file '" + path_ + "/" + (*file)->name + "': only bytes of one sector are replaced");
  }
  while (!bytes.empty()) {
    const ssize_t put = again_when_interrupted(
        [&] { return ::pwrite((*file)->descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset)); });
    if (put < 0) return fail(failure("writing it", (*file)->name, errno));
    offset += static_cast<std::uint64_t>(put);
    bytes = bytes.subspan(static_cast<std::size_t>(put));
  }
  return {};
}

Status LinuxDisk::truncate(FileHandle handle, std::uint64_t size) {
  const auto file = file_of(handle, false);
  if (!file) return fail(file.error());
  if (size > (*file)->end) {
    return fail(Errc::kBadValue, "file '" + path_ + "/" + (*file)->name + "': is shorter than " + std::to_string(size));
  }
  if (again_when_interrupted([&] { return ::ftruncate((*file)->descriptor, static_cast<off_t>(size)); }) < 0) {
    return fail(failure("shortening it", (*file)->name, errno));
  }
  (*file)->end = size;
  return {};
}

void LinuxDisk::start_write_out(FileHandle handle) {
  const auto file = file_of(handle, false);
  if (!file) return;
  (void)::sync_file_range((*file)->descriptor, 0, 0, SYNC_FILE_RANGE_WRITE);
  // Memory that goes back to the kernel is used again for the next bytes, instead of the memory of everything else on the board.
  const std::uint64_t begin = (*file)->let_go, end = (*file)->end;
  if (end < begin + 2 * kKeptInMemory) return;
  (*file)->let_go = end - kKeptInMemory;
  (void)::posix_fadvise((*file)->descriptor, static_cast<off_t>(begin), static_cast<off_t>((*file)->let_go - begin),
                        POSIX_FADV_DONTNEED);
}

void LinuxDisk::preallocate(FileHandle handle, std::uint64_t bytes) {
  const auto file = file_of(handle, false);
  const auto length = static_cast<off_t>(bytes);
  if (file) (void)::fallocate((*file)->descriptor, FALLOC_FL_KEEP_SIZE, static_cast<off_t>((*file)->end), length);
}

Status LinuxDisk::sync_all() {
  if (again_when_interrupted([&] { return ::syncfs(root_); }) < 0) return fail(failure("syncing all", "", errno));
  return {};
}

Status LinuxDisk::sync(FileHandle handle) {
  const auto file = files_.find(handle);
  if (file == files_.end()) return fail(Errc::kWrongState, "file handle " + std::to_string(handle) + ": is not open");
  if (again_when_interrupted([&] { return ::fsync(file->second.descriptor); }) < 0) {
    return fail(failure("syncing it", file->second.name, errno));
  }
  return {};
}

void LinuxDisk::close(FileHandle handle) {
  const auto file = files_.find(handle);
  if (file == files_.end()) return;
  ::close(file->second.descriptor);
  files_.erase(file);
}

Result<std::vector<std::uint8_t>> LinuxDisk::read(const std::string& name, std::uint64_t limit_bytes) {
  if (auto checked = check(name); !checked) return fail(checked.error());
  const Descriptor fd(open_beneath(name, O_RDONLY | O_NONBLOCK));
  if (!fd) return fail(failure("opening it", name, errno));
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
    return fail(Errc::kTooLarge, "file '" + path_ + "/" + name + "': is " +
                                     std::to_string(std::max<std::uint64_t>(length, bytes.size())) +
                                     " bytes, over the limit of " + std::to_string(limit_bytes));
  }
  return bytes;
}

Result<std::uint64_t> LinuxDisk::size(const std::string& name) {
  if (auto checked = check(name); !checked) return fail(checked.error());
  const Descriptor fd(open_beneath(name, O_PATH));
  if (!fd) return fail(failure("opening it", name, errno));
  struct stat about {};
  if (::fstat(fd.get(), &about) < 0) return fail(failure("reading it", name, errno));
  if (!S_ISREG(about.st_mode)) return fail(Errc::kIo, "file '" + path_ + "/" + name + "': is not a file");
  return static_cast<std::uint64_t>(about.st_size);
}

Status LinuxDisk::rename(const std::string& from, const std::string& to) {
  if (auto checked = check(from); !checked) return checked;
  if (auto checked = check(to); !checked) return checked;
  const Descriptor from_folder(open_beneath(folder_of(from), O_PATH | O_DIRECTORY));
  if (!from_folder) return fail(failure("renaming it", from, errno));
  const Descriptor to_folder(open_beneath(folder_of(to), O_PATH | O_DIRECTORY));
  if (!to_folder) return fail(failure("renaming it", to, errno));
  for (const auto& [folder, name] : {std::pair{&from_folder, &from}, std::pair{&to_folder, &to}}) {
    struct stat about {};
    if (::fstatat(folder->get(), last_part(*name), &about, AT_SYMLINK_NOFOLLOW) == 0 && S_ISDIR(about.st_mode)) {
      return fail(Errc::kUnsupported, "file '" + path_ + "/" + *name + "': folders are not renamed or replaced");
    }
  }
  if (::renameat(from_folder.get(), last_part(from), to_folder.get(), last_part(to)) < 0) {
    return fail(failure("renaming it", from, errno));
  }
  return {};
}

Status LinuxDisk::remove(const std::string& name) {
  if (auto checked = check(name); !checked) return checked;
  const Descriptor folder(open_beneath(folder_of(name), O_PATH | O_DIRECTORY));
  if (!folder) return fail(failure("removing it", name, errno));
  if (::unlinkat(folder.get(), last_part(name), 0) == 0) return {};
  if (errno != EISDIR) return fail(failure("removing it", name, errno));
  if (::unlinkat(folder.get(), last_part(name), AT_REMOVEDIR) < 0) return fail(failure("removing it", name, errno));
  return {};
}

Status LinuxDisk::make_folder(const std::string& name) {
  if (auto checked = check(name); !checked) return checked;
  const Descriptor folder(open_beneath(folder_of(name), O_PATH | O_DIRECTORY));
  if (!folder) return fail(failure("making it", name, errno));
  if (::mkdirat(folder.get(), last_part(name), kFolderMode) == 0) return {};
  const int error = errno;
  struct stat about {};
  const bool there = error == EEXIST && ::fstatat(folder.get(), last_part(name), &about, AT_SYMLINK_NOFOLLOW) == 0;
  if (there && S_ISDIR(about.st_mode)) return {};
  return fail(failure("making it", name, error));
}

Status LinuxDisk::sync_folder(const std::string& name) {
  if (!name.empty()) {
    if (auto checked = check(name); !checked) return checked;
  }
  const Descriptor folder(open_beneath(name.empty() ? "." : name, O_RDONLY | O_DIRECTORY));
  if (!folder) return fail(failure("syncing it", name, errno));
  if (again_when_interrupted([&] { return ::fsync(folder.get()); }) < 0) {
    return fail(failure("syncing it", name, errno));
  }
  return {};
}

Result<std::vector<std::string>> LinuxDisk::list(const std::string& folder) {
  if (!folder.empty()) {
    if (auto checked = check(folder); !checked) return fail(checked.error());
  }
  Descriptor fd(open_beneath(folder.empty() ? "." : folder, O_RDONLY | O_DIRECTORY));
  if (!fd) return fail(failure("listing it", folder, errno));
  DIR* const stream = ::fdopendir(fd.get());
  if (stream == nullptr) return fail(failure("listing it", folder, errno));
  fd.release();  // the stream now closes it
  std::vector<std::string> names;
  errno = 0;
  while (const dirent* entry = ::readdir(stream)) {
    const std::string name = entry->d_name;
    if (name != "." && name != "..") names.push_back(name);
  }
  const int error = errno;
  ::closedir(stream);
  if (error != 0) return fail(failure("listing it", folder, error));
  std::sort(names.begin(), names.end());
  return names;
}

Result<std::uint64_t> LinuxDisk::free_bytes() {
  struct statvfs about {};
  if (::fstatvfs(root_, &about) < 0) return fail(failure("asking for free room", "", errno));
  return static_cast<std::uint64_t>(about.f_bavail) * about.f_frsize;
}

Result<std::uint64_t> LinuxDisk::total_bytes() {
  struct statvfs about {};
  if (::fstatvfs(root_, &about) < 0) return fail(failure("asking for its size", "", errno));
  return static_cast<std::uint64_t>(about.f_blocks) * about.f_frsize;
}

}  // namespace nodal::hal::linux_os
