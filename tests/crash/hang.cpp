// Preloaded into nodald: one of its threads hangs in a system call while a file exists.
//
//   NODAL_HANG_THREAD   the thread's name
//   NODAL_HANG_WHILE    the file; written to when the thread begins to hang
//
// Without <fcntl.h> and <poll.h>, which define the functions below inline when library calls are checked.
#include <dlfcn.h>
#include <pthread.h>
#include <unistd.h>

#include <csignal>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

constexpr int kCreate = 0100;  // O_CREAT
using Count = unsigned long;   // nfds_t

/// Where the thread has this name and the file exists: returns when the file is gone.
void hang_if_told() {
  const char* const thread = std::getenv("NODAL_HANG_THREAD");
  const char* const file = std::getenv("NODAL_HANG_WHILE");
  char name[16] = "";
  if (!thread || !file || ::pthread_getname_np(::pthread_self(), name, sizeof name) != 0) return;
  if (std::strcmp(name, thread) != 0 || ::access(file, F_OK) != 0) return;
  (void)!::truncate(file, 1);
  while (::access(file, F_OK) == 0) ::usleep(5000);
}

template <class Function>
Function real(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int fsync(int fd) {
  static const auto next = real<int (*)(int)>("fsync");
  hang_if_told();
  return next(fd);
}

int ppoll(void* fds, Count count, const struct timespec* timeout, const sigset_t* signals) {
  static const auto next = real<int (*)(void*, Count, const struct timespec*, const sigset_t*)>("ppoll");
  hang_if_told();
  return next(fds, count, timeout, signals);
}

/// Fortified calls of ppoll(): the same.
int __ppoll_chk(void* fds, Count count, const struct timespec* timeout, const sigset_t* signals, size_t) {
  return ppoll(fds, count, timeout, signals);
}

int open(const char* path, int flags, ...) {
  static const auto next = real<int (*)(const char*, int, ...)>("open");
  std::va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & kCreate) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  hang_if_told();
  return next(path, flags, mode);
}
}
