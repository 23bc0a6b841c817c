#include "host_tool/web/program/listening.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

namespace nodal::host::web {
namespace {

constexpr int kFirstOfSystemd = 3;  // SD_LISTEN_FDS_START
constexpr int kBacklog = 64;

tl::unexpected<Error> refused(const std::string& path, const char* what) {
  return fail(Errc::kIo, fmt::format("unix:{}: {}: {}", path, what, std::strerror(errno)));
}

}  // namespace

int socket_of_systemd() {
  const char* const process = std::getenv("LISTEN_PID");
  const char* const count = std::getenv("LISTEN_FDS");
  if (process == nullptr || count == nullptr || std::to_string(::getpid()) != process || std::strcmp(count, "1") != 0)
    return -1;
  return kFirstOfSystemd;
}

Result<hal::Descriptor> listen_at(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path)
    return fail(Errc::kBadValue, fmt::format("--socket has 1 to {} bytes", sizeof address.sun_path - 1));
  std::memcpy(address.sun_path, path.c_str(), path.size());
  const auto* const named = reinterpret_cast<const sockaddr*>(&address);
  hal::Descriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (socket.get() < 0) return refused(path, "no socket");
  struct stat file {};
  if (::lstat(path.c_str(), &file) == 0 && S_ISSOCK(file.st_mode)) {
    const hal::Descriptor other(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (::connect(other.get(), named, sizeof address) == 0)
      return fail(Errc::kExists, fmt::format("unix:{}: a program listens there already", path));
    ::unlink(path.c_str());
  }
  const mode_t before = ::umask(0117);
  const int bound = ::bind(socket.get(), named, sizeof address);
  ::umask(before);
  if (bound != 0) return refused(path, "cannot be made");
  if (::listen(socket.get(), kBacklog) != 0) return refused(path, "cannot listen");
  return socket;
}

}  // namespace nodal::host::web
