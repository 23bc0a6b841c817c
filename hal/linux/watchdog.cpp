#include "hal/linux/watchdog.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace nodal::hal::linux_os {

namespace {

std::string notify_socket() {
  const char* name = std::getenv("NOTIFY_SOCKET");
  return name == nullptr ? "" : name;
}

}  // namespace

LinuxWatchdog::LinuxWatchdog() : LinuxWatchdog(notify_socket()) {}

LinuxWatchdog::LinuxWatchdog(const std::string& name) : address_(name) {
  if (address_.size() < 2 || (address_[0] != '/' && address_[0] != '@')) return;  // other forms are not supported
  if (address_.size() >= sizeof(sockaddr_un::sun_path)) return;
  if (address_[0] == '@') address_[0] = '\0';
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

LinuxWatchdog::~LinuxWatchdog() {
  if (socket_ >= 0) ::close(socket_);
}

void LinuxWatchdog::ready() { send("READY=1"); }
void LinuxWatchdog::feed() { send("WATCHDOG=1"); }
void LinuxWatchdog::stopping() { send("STOPPING=1"); }
void LinuxWatchdog::status(std::string_view line) {
  send("STATUS=" + std::string(line.substr(0, line.find_first_of("\r\n"))));
}

void LinuxWatchdog::send(const std::string& message) {
  if (socket_ < 0) return;
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  // Sent once, without waiting: the next notification follows soon, and a missing supervisor is no error.
  static_cast<void>(
      ::sendto(socket_, message.data(), message.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&to), length));
}

}  // namespace nodal::hal::linux_os
