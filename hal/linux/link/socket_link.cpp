#include "hal/linux/link/socket_link.h"

#include <fmt/format.h>

#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "hal/linux/link/address.h"
#include "hal/linux/link/descriptor_link.h"
#include "protocol/base/try.h"

namespace nodal::hal {
namespace {

constexpr int kConnectTimeoutMs = 2000;
constexpr int kBacklog = 16;
constexpr int kLockTimeoutMs = 3000;  ///< listening takes a few milliseconds; a longer holder hangs
constexpr int kLockRetryMs = 20;
constexpr mode_t kSocketMode = 0660;
constexpr mode_t kLockMode = 0600;

Descriptor open_socket(const SocketAddress& address) {
  return Descriptor(::socket(address.storage.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

/// Returns 0 when connected, else an errno.
int connect_within(int fd, const SocketAddress& address, int timeout_ms) {
  while (::connect(fd, address.get(), address.size) < 0) {
    if (errno == EINTR) continue;
    if (errno == EISCONN) return 0;
    if (errno != EINPROGRESS && errno != EALREADY) return errno;
    pollfd wait{fd, POLLOUT, 0};
    const int ready = ::poll(&wait, 1, timeout_ms);
    if (ready == 0) return ETIMEDOUT;
    if (ready < 0 && errno != EINTR) return errno;
    int error = 0;
    socklen_t size = sizeof(error);
    if (ready > 0) {
      getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
      return error;
    }
  }
  return 0;
}

class SocketListener final : public LinkListenerPort {
 public:
  SocketListener(Descriptor socket, std::string address, std::string path)
      : socket_(std::move(socket)), address_(std::move(address)), path_(std::move(path)) {
    known_ = ::stat(path_.c_str(), &file_) == 0;
  }

  // Removes the file only if it is still ours: another program may have put its own in its place.
  ~SocketListener() override {
    struct stat now {};
    if (known_ && ::stat(path_.c_str(), &now) == 0 && now.st_ino == file_.st_ino && now.st_dev == file_.st_dev) {
      ::unlink(path_.c_str());
    }
  }
  SocketListener(const SocketListener&) = delete;
  SocketListener& operator=(const SocketListener&) = delete;

  Result<std::unique_ptr<LinkPort>> accept() override {
    while (true) {
      Descriptor link(::accept4(socket_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (link.get() >= 0) {
        const int fd = link.get();
        const std::optional<PeerIdentity> identity = who_is(fd);
        std::string peer = address_;
        if (identity) {
          peer += fmt::format(" (process {} of user {})", identity->process, identity->user);
        }
        return std::make_unique<DescriptorLink>(std::move(link), fd, std::move(peer), identity);
      }
      if (errno == EINTR || errno == ECONNABORTED) continue;  // the client gave up; the next one may still be there
      if (errno == EAGAIN || errno == EWOULDBLOCK) return nullptr;
      return system_error(Errc::kIo, address_ + ": taking a new link", errno);
    }
  }

  const std::string& address() const { return address_; }
  void add_wake_ups(WakeUps& to) const override { to.on({socket_.get(), true, false}); }

 private:
  /// The kernel records the process when the peer connects: unix(7), SO_PEERCRED.
  static std::optional<PeerIdentity> who_is(int fd) {
    ucred who{};
    socklen_t size = sizeof(who);
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) != 0) return std::nullopt;
    return PeerIdentity{who.uid, who.pid};
  }

  Descriptor socket_;
  std::string address_;
  std::string path_;
  struct stat file_ {};
  bool known_ = false;
};

/// Removes a socket file without a listener; kExists if there is a listener, or if it is not a socket.
Status remove_stale(const SocketAddress& address) {
  struct stat file {};
  if (::lstat(address.path.c_str(), &file) != 0) return {};
  if (!S_ISSOCK(file.st_mode)) {
    return fail(Errc::kExists, address.text +
                                   ": there is something at that path that is not a socket; remove it or "
                                   "choose another path");
  }
  const Descriptor probe = open_socket(address);
  const int error = probe.get() < 0 ? errno : connect_within(probe.get(), address, kConnectTimeoutMs);
  if (error != ECONNREFUSED && error != ENOENT) {
    return fail(Errc::kExists, address.text + ": a program listens there already; stop it or choose another path");
  }
  if (error == ECONNREFUSED && ::unlink(address.path.c_str()) != 0 && errno != ENOENT) {
    return system_error(Errc::kIo, address.text + ": removing what a dead program left", errno);
  }
  return {};
}

/// Sets the group first, because chown(2) may clear mode bits.
Status give_to(const SocketAddress& address, const SocketFile& file) {
  if (!file.group.empty()) {
    const group* const found = ::getgrnam(file.group.c_str());
    if (found == nullptr) return fail(Errc::kNotFound, address.text + ": there is no group '" + file.group + "'");
    constexpr auto kKeepOwner = static_cast<uid_t>(-1);
    if (::lchown(address.path.c_str(), kKeepOwner, found->gr_gid) != 0) {
      return system_error(Errc::kIo, address.text + ": giving it to group '" + file.group + "'", errno);
    }
  }
  if (file.mode && ::chmod(address.path.c_str(), static_cast<mode_t>(*file.mode)) != 0) {
    return system_error(Errc::kIo, address.text + ": setting its mode", errno);
  }
  return {};
}

/// Two programs that start at once must not both find a stale file, else the second removes the first's new socket. The
/// lock is on a file beside the socket that only this user can open; the folder itself could be locked by everyone who
/// can read it. The lock file is never removed: a removed file no longer excludes processes that have it open.
Result<Descriptor> lock_beside(const SocketAddress& address) {
  const std::string file = address.path + ".lock";
  Descriptor lock(::open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, kLockMode));
  if (lock.get() < 0) return system_error(Errc::kIo, address.text + ": its lock file " + file, errno);
  struct stat known {};
  if (::fstat(lock.get(), &known) != 0 || !S_ISREG(known.st_mode) || known.st_uid != ::geteuid()) {
    return fail(Errc::kExists, address.text + ": " + file + " is not a file of this user; remove it");
  }
  for (int waited_ms = 0; ::flock(lock.get(), LOCK_EX | LOCK_NB) != 0; waited_ms += kLockRetryMs) {
    if (errno == EINTR) continue;
    if (errno != EWOULDBLOCK) return system_error(Errc::kIo, address.text + ": locking " + file, errno);
    if (waited_ms >= kLockTimeoutMs) {
      return fail(Errc::kExists, address.text + ": another program of this user holds the lock " + file +
                                     "; end it (fuser names it) or choose another path");
    }
    ::poll(nullptr, 0, kLockRetryMs);
  }
  return lock;
}

Result<std::unique_ptr<LinkListenerPort>> listen_unix(const SocketAddress& address, const SocketFile& file) {
  NODAL_TRY(lock_beside(address));
  NODAL_TRY(remove_stale(address));

  Descriptor socket = open_socket(address);
  if (socket.get() < 0) return system_error(Errc::kIo, address.text, errno);
  // Before bind(), which applies the umask, so that the file's permissions are never wider than the final ones.
  ::fchmod(socket.get(), static_cast<mode_t>(file.mode.value_or(kSocketMode)));
  if (::bind(socket.get(), address.get(), address.size) != 0) return system_error(Errc::kIo, address.text, errno);
  Status ready = give_to(address, file);
  // Clients can connect only after listen(), so group and mode are set before the first one.
  if (ready && ::listen(socket.get(), kBacklog) != 0) ready = system_error(Errc::kIo, address.text, errno);
  if (!ready) {
    ::unlink(address.path.c_str());
    return fail(ready.error());
  }
  return std::make_unique<SocketListener>(std::move(socket), address.text, address.path);
}

}  // namespace

namespace {

/// Why this user may not open a socket, and what to do.
std::string not_allowed(const std::string& path) {
  struct stat about {};
  if (::stat(path.c_str(), &about) != 0) return ": this user may not enter the socket's folder; sudo may";
  const group* const owner = (about.st_mode & S_IWGRP) != 0 ? ::getgrgid(about.st_gid) : nullptr;
  if (owner == nullptr) return ": this user may not open the socket; its owner and root may";
  const std::string name = owner->gr_name;
  return ": this user may not open the socket; the group '" + name + "' may: sudo usermod -aG " + name +
         " $USER, then log in again";
}

}  // namespace

Result<std::unique_ptr<LinkPort>> connect_link(std::string_view text) {
  NODAL_TRY_ASSIGN(const auto address, parse_address(text));
  Descriptor socket = open_socket(address);
  if (socket.get() < 0) return system_error(Errc::kIo, address.text, errno);
  switch (const int error = connect_within(socket.get(), address, kConnectTimeoutMs)) {
    case 0: break;
    case ENOENT:
      return fail(Errc::kUnreachable, address.text +
                                          ": there is no such socket; is nodald running, and is this the "
                                          "socket its rig.toml names?");
    case ECONNREFUSED: return fail(Errc::kUnreachable, address.text + ": nobody listens there; is nodald running?");
    case EACCES:
    case EPERM: return fail(Errc::kUnreachable, address.text + not_allowed(address.path));
    case EAGAIN: return fail(Errc::kUnreachable, address.text + ": the program that listens there takes no links now");
    default: return system_error(Errc::kUnreachable, address.text, error);
  }
  const int fd = socket.get();
  return std::make_unique<DescriptorLink>(std::move(socket), fd, address.text);
}

Result<std::unique_ptr<LinkListenerPort>> listen_link(std::string_view text, const SocketFile& file) {
  NODAL_TRY_ASSIGN(const auto address, parse_address(text));
  return listen_unix(address, file);
}

const std::string& listener_address(const LinkListenerPort& listener) {
  static const std::string kNone;
  const auto* known = dynamic_cast<const SocketListener*>(&listener);
  return known != nullptr ? known->address() : kNone;
}

}  // namespace nodal::hal
