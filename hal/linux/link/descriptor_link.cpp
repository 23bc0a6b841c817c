#include "hal/linux/link/descriptor_link.h"

#include <fmt/format.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace nodal::hal {
namespace {

bool is_socket(int fd) {
  struct stat status {};
  return fstat(fd, &status) == 0 && S_ISSOCK(status.st_mode);
}

/// Sets O_NONBLOCK and returns the earlier flags.
int make_nonblocking(int fd) {
  const int flags = fcntl(fd, F_GETFL);
  if (flags >= 0) fcntl(fd, F_SETFL, flags | O_NONBLOCK);
  return flags;
}

/// write() to a pipe without a reader raises SIGPIPE, which would end the program; the signal's handler is not ours to
/// change. So this thread blocks the signal during the call, and removes one that became pending.
ssize_t write_without_signal(int fd, std::span<const std::uint8_t> from) {
  sigset_t pipe_signal, before, pending;
  sigemptyset(&pipe_signal);
  sigaddset(&pipe_signal, SIGPIPE);
  sigpending(&pending);
  const bool was_pending = sigismember(&pending, SIGPIPE) == 1;
  pthread_sigmask(SIG_BLOCK, &pipe_signal, &before);
  const ssize_t n = ::write(fd, from.data(), from.size());
  const int error = errno;
  if (n < 0 && error == EPIPE && !was_pending) {
    const timespec at_once{0, 0};
    while (sigtimedwait(&pipe_signal, nullptr, &at_once) < 0 && errno == EINTR) {}
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  errno = error;
  return n;
}

bool is_gone(int error) { return error == EPIPE || error == ECONNRESET || error == ENOTCONN || error == ETIMEDOUT; }

}  // namespace

Descriptor::~Descriptor() {
  if (fd_ >= 0) ::close(fd_);
}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}

int Descriptor::release() { return std::exchange(fd_, -1); }

tl::unexpected<Error> system_error(Errc code, const std::string& where, int number) {
  return fail(code, where + ": " + std::generic_category().message(number));
}

DescriptorLink::DescriptorLink(Descriptor read_from, int write_to, std::string peer,
                               std::optional<PeerIdentity> identity)
    : read_(std::move(read_from)),
      write_(write_to),
      write_is_socket_(is_socket(write_to)),
      peer_(std::move(peer)),
      identity_(identity) {
  read_flags_ = make_nonblocking(read_.get());
  write_flags_ = write_ == read_.get() ? read_flags_ : make_nonblocking(write_);
}

DescriptorLink::~DescriptorLink() { close_descriptors(); }

// Restores the flags: they belong to the open file, which a shell may share and still use.
void DescriptorLink::close_descriptors() {
  if (write_ >= 0 && write_ != read_.get()) {
    if (write_flags_ >= 0) fcntl(write_, F_SETFL, write_flags_);
    ::close(write_);
  }
  write_ = -1;
  if (read_.get() >= 0) {
    if (read_flags_ >= 0) fcntl(read_.get(), F_SETFL, read_flags_);
    read_ = Descriptor();
  }
}

Result<std::size_t> DescriptorLink::read(std::span<std::uint8_t> into) {
  if (into.empty()) return 0;
  while (true) {
    const ssize_t n = ::read(read_.get(), into.data(), into.size());
    if (n > 0) return static_cast<std::size_t>(n);
    if (n == 0) return fail(Errc::kLinkClosed, peer_ + ": " + closed_because());
    if (errno == EINTR) continue;
    if (errno == EAGAIN || errno == EWOULDBLOCK) return 0;
    return system_error(is_gone(errno) ? Errc::kLinkClosed : Errc::kIo, peer_, errno);
  }
}

Result<std::size_t> DescriptorLink::write(std::span<const std::uint8_t> from) {
  if (from.empty()) return 0;
  while (true) {
    const ssize_t n =
        write_is_socket_ ? ::send(write_, from.data(), from.size(), MSG_NOSIGNAL) : write_without_signal(write_, from);
    if (n >= 0) return static_cast<std::size_t>(n);
    if (errno == EINTR) continue;
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS) return 0;
    if (is_gone(errno)) return fail(Errc::kLinkClosed, peer_ + ": the other end closed the link");
    return system_error(Errc::kIo, peer_, errno);
  }
}

void DescriptorLink::add_wake_ups(WakeUps& to, bool to_read, bool to_write) const {
  if (read_.get() == write_) return to.on({write_, to_read, to_write});
  to.on({read_.get(), to_read, false});
  to.on({write_, false, to_write});
}

Result<std::unique_ptr<LinkPort>> descriptor_link(int read_from, int write_to, std::string peer) {
  for (const int fd : {read_from, write_to}) {
    if (fcntl(fd, F_GETFD) >= 0) continue;
    return system_error(Errc::kBadValue, fmt::format("{}: descriptor {}", peer, fd), errno);
  }
  return std::make_unique<DescriptorLink>(Descriptor(read_from), write_to, std::move(peer));
}

}  // namespace nodal::hal
