// systemd's notification protocol (sd_notify(3)) without libsystemd: datagrams to the socket in $NOTIFY_SOCKET.
#pragma once

#include <string>

#include "hal/watchdog.h"

namespace nodal::hal::linux_os {

/// Threading: thread-bound to the supervisor.
/// Ownership: closes its socket.
/// Errors: none; without $NOTIFY_SOCKET, or without a listener there, it does nothing.
class LinuxWatchdog final : public WatchdogPort {
 public:
  /// Reads $NOTIFY_SOCKET: a path, or "@name" for Linux's abstract sockets.
  LinuxWatchdog();
  explicit LinuxWatchdog(const std::string& notify_socket);
  ~LinuxWatchdog() override;
  LinuxWatchdog(const LinuxWatchdog&) = delete;
  LinuxWatchdog& operator=(const LinuxWatchdog&) = delete;

  void ready() override;
  void feed() override;
  void stopping() override;
  /// Only the first line is sent: a line break would begin another assignment.
  void status(std::string_view line) override;

 private:
  void send(const std::string& message);

  int socket_ = -1;
  std::string address_;  ///< address in the form of sockaddr_un: a leading '\0' marks an abstract name
};

}  // namespace nodal::hal::linux_os
