// The Unix socket that nodal-web answers at.
#pragma once

#include <string>

#include "hal/linux/link/descriptor_link.h"
#include "protocol/base/result.h"

namespace nodal::host::web {

/// The socket that systemd has opened for this process (sd_listen_fds(3)); -1 if there is none.
int socket_of_systemd();

/// A socket at a path, for this user and group only. A file that no program listens at is replaced.
/// Errors: kExists if a program listens there; kBadValue for a path that is too long; kIo.
Result<hal::Descriptor> listen_at(const std::string& path);

}  // namespace nodal::host::web
