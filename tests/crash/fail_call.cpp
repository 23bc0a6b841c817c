// Replaces calls of the C library by preloading: the n-th that concerns files beneath a folder fails with EIO, as from
// a disk with an error. FAIL_CALL_FOLDER: the folder. FAIL_CALL: n, from 0. FAIL_CALL_COUNT: a file that gets a byte
// for each such call.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

std::atomic<long> calls{0};
const char* folder = nullptr;
long fails_at = -1;
int count = -1;

[[gnu::constructor]] void read_environment() {
  folder = std::getenv("FAIL_CALL_FOLDER");
  const char* const number = std::getenv("FAIL_CALL");
  const char* const file = std::getenv("FAIL_CALL_COUNT");
  if (number) fails_at = std::atol(number);
  if (file)
    count = static_cast<int>(::syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600));
}

/// Counts a call that concerns the folder.
bool fails() {
  if (count >= 0) (void)::syscall(SYS_write, count, ".", 1);
  if (calls.fetch_add(1) != fails_at) return false;
  errno = EIO;
  return true;
}
bool is_beneath(const char* path) { return folder && path && std::strncmp(path, folder, std::strlen(folder)) == 0; }
bool is_beneath(int fd) {
  if (!folder) return false;
  char name[64], path[PATH_MAX];
  std::snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
  const ssize_t length = ::readlink(name, path, sizeof path - 1);
  if (length <= 0) return false;
  path[length] = 0;
  return is_beneath(path);
}
template <class Call>
Call next(const char* name) {
  return reinterpret_cast<Call>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = va_arg(rest, mode_t);
  va_end(rest);
  if (is_beneath(path) && fails()) return -1;
  return static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}
ssize_t pread(int fd, void* bytes, std::size_t length, off_t at) {
  static const auto real = next<decltype(&pread)>("pread");
  return is_beneath(fd) && fails() ? -1 : real(fd, bytes, length, at);
}
ssize_t pwrite(int fd, const void* bytes, std::size_t length, off_t at) {
  static const auto real = next<decltype(&pwrite)>("pwrite");
  return is_beneath(fd) && fails() ? -1 : real(fd, bytes, length, at);
}
ssize_t write(int fd, const void* bytes, std::size_t length) {
  static const auto real = next<decltype(&write)>("write");
  return is_beneath(fd) && fails() ? -1 : real(fd, bytes, length);
}
int fsync(int fd) {
  static const auto real = next<decltype(&fsync)>("fsync");
  return is_beneath(fd) && fails() ? -1 : real(fd);
}
int ftruncate(int fd, off_t length) {
  static const auto real = next<decltype(&ftruncate)>("ftruncate");
  return is_beneath(fd) && fails() ? -1 : real(fd, length);
}
int rename(const char* from, const char* to) {
  static const auto real = next<decltype(&rename)>("rename");
  return is_beneath(to) && fails() ? -1 : real(from, to);
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  static const auto real = next<decltype(&renameat2)>("renameat2");
  return is_beneath(to) && fails() ? -1 : real(from_folder, from, to_folder, to, flags);
}
}
