#include "protocol/files/open_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

#include "protocol/base/try.h"

namespace nodal {
namespace {

constexpr mode_t kMode = 0666;  // the umask removes what it forbids

tl::unexpected<Error> refused(int error) {
  if (error == ENXIO) return fail(Errc::kBadFormat, "no program reads from this FIFO, or the device is not there");
  if (error == EISDIR) return fail(Errc::kBadFormat, "is a folder");
  if (error == EEXIST) return fail(Errc::kExists, "is there already");
  return fail(error == ENOENT || error == ENOTDIR ? Errc::kNotFound : Errc::kIo, std::strerror(error));
}

Result<int> opened(const std::filesystem::path& file, int flags) {
  for (;;) {
    const int fd = ::open(file.c_str(), flags | O_NONBLOCK | O_CLOEXEC | O_NOCTTY, kMode);
    if (fd >= 0) return fd;
    if (errno != EINTR) return refused(errno);
  }
}

Result<int> regular(Result<int> fd) {
  if (!fd) return fd;
  struct stat about {};
  const int error = ::fstat(*fd, &about) == 0 ? 0 : errno;
  if (error == 0 && S_ISREG(about.st_mode)) return fd;
  ::close(*fd);
  if (error != 0) return refused(error);
  return fail(Errc::kBadFormat, S_ISDIR(about.st_mode) ? "is a folder" : "is not a regular file");
}

Result<FilePtr> buffered(Result<int> fd, const char* mode) {
  if (!fd) return fail(fd.error());
  FilePtr file(::fdopen(*fd, mode));
  if (file) return file;
  const int error = errno;
  ::close(*fd);
  return refused(error);
}

}  // namespace

Result<int> open_descriptor_to_read(const std::filesystem::path& file) { return regular(opened(file, O_RDONLY)); }

Result<FilePtr> open_to_read(const std::filesystem::path& file) {
  return buffered(open_descriptor_to_read(file), "rb");
}

Result<FilePtr> create_to_write(const std::filesystem::path& file) {
  return buffered(opened(file, O_WRONLY | O_CREAT | O_EXCL), "w");
}

Result<int> open_descriptor_to_write(const std::filesystem::path& file) {
  NODAL_TRY_ASSIGN(const int fd, opened(file, O_WRONLY | O_CREAT));
  const int flags = ::fcntl(fd, F_GETFL);
  if (flags >= 0 && ::fcntl(fd, F_SETFL, flags & ~O_NONBLOCK) == 0) return fd;
  const int error = errno;
  ::close(fd);
  return refused(error);
}

Result<int> open_unnamed(const std::filesystem::path& folder) {
  // Not O_TMPFILE, which network folders lack.
  std::string name = (folder / ".nodal-XXXXXX").string();
  const int fd = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd < 0) return refused(errno);
  ::unlink(name.c_str());
  return fd;
}

}  // namespace nodal
