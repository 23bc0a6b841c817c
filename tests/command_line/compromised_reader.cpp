// A picture's reader that an attacker has taken over: preloaded, it stands before libpng and, when nodal begins to read
// a PNG, tries what an attacker would try. Each attempt is a line of standard error: "attempt NAME: allowed|denied".
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

void tell(const char* name, bool allowed) {
  std::fprintf(stderr, "attempt %s: %s\n", name, allowed ? "allowed" : "denied");
}

void try_open(const char* name, const char* file, int flags) {
  const int fd = file == nullptr ? -1 : ::open(file, flags | O_CLOEXEC, 0600);
  tell(name, fd >= 0);
  if (fd >= 0) ::close(fd);
}

void try_socket(const char* name, int family, int kind) {
  const int fd = ::socket(family, kind, 0);
  tell(name, fd >= 0);
  if (fd >= 0) ::close(fd);
}

/// Whether another program can be started.
void try_to_start(const char* name, const char* program) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::execl(program, program, nullptr);
    ::_exit(77);
  }
  int status = 0;
  while (child > 0 && ::waitpid(child, &status, 0) < 0 && errno == EINTR) {}
  tell(name, child > 0 && WIFEXITED(status) && WEXITSTATUS(status) != 77);
}

void attempt_everything() {
  static bool done = false;
  if (done) return;
  done = true;
  try_open("secret", std::getenv("TEST_SECRET"), O_RDONLY);
  try_open("passwords", "/etc/passwd", O_RDONLY);
  try_open("overwrite the input", std::getenv("TEST_INPUT"), O_WRONLY);
  try_open("write elsewhere", std::getenv("TEST_ELSEWHERE"), O_WRONLY | O_CREAT);
  try_open("read the input", std::getenv("TEST_INPUT"), O_RDONLY);
  try_open("write beside the output", std::getenv("TEST_BESIDE"), O_WRONLY | O_CREAT);
  try_socket("internet", AF_INET, SOCK_STREAM);
  try_socket("internet 6", AF_INET6, SOCK_DGRAM);
  try_socket("unix socket", AF_UNIX, SOCK_STREAM);
  try_socket("netlink", AF_NETLINK, SOCK_RAW);
  try_to_start("program", "/bin/true");
  // SEIZE does not stop it, and ends with this process.
  tell("trace the parent", ::ptrace(PTRACE_SEIZE, ::getppid(), nullptr, nullptr) == 0);
}

}  // namespace

extern "C" {

/// libpng's function of that name, called at the beginning of every PNG.
void* png_create_read_struct(const char* version, void* error, void* on_error, void* on_warning) {
  attempt_everything();
  using Create = void* (*)(const char*, void*, void*, void*);
  const auto real = reinterpret_cast<Create>(::dlsym(RTLD_NEXT, "png_create_read_struct"));
  return real == nullptr ? nullptr : real(version, error, on_error, on_warning);
}

}  // extern "C"
