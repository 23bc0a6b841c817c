#include "faulty_wire.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace nodal::crash {
namespace {

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) throw std::runtime_error(path + ": is too long");
  std::copy(path.begin(), path.end(), address.sun_path);
  return address;
}

bool write_all(int to, const std::uint8_t* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t wrote = ::send(to, bytes, count, MSG_NOSIGNAL);
    if (wrote <= 0) return false;
    bytes += wrote;
    count -= static_cast<std::size_t>(wrote);
  }
  return true;
}

}  // namespace

FaultyWire::FaultyWire(std::string path, std::string rig)
    : path_(std::move(path)), rig_(std::move(rig)), listener_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  const sockaddr_un address = address_of(path_);
  if (listener_ < 0 || ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener_, 8) != 0) {
    throw std::runtime_error(path_ + ": cannot listen: " + std::strerror(errno));
  }
  thread_ = std::thread([this] { run(); });
}

FaultyWire::~FaultyWire() {
  stop_ = true;
  thread_.join();
  ::close(listener_);
  ::unlink(path_.c_str());
}

void FaultyWire::run() {
  while (!stop_) {
    pollfd waits{listener_, POLLIN, 0};
    if (::poll(&waits, 1, 20) <= 0) continue;
    const int host = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (host < 0) continue;
    serve(host);
    ::close(host);
  }
}

void FaultyWire::serve(int host) {
  const std::uint64_t cut_at = cut_at_.exchange(kNever), flip_at = flip_at_.exchange(kNever);
  passed_ = 0;
  const int rig = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_un address = address_of(rig_);
  bool open = ::connect(rig, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  std::array<std::uint8_t, 65536> bytes;
  while (open && !stop_) {
    std::array<pollfd, 2> waits{pollfd{host, POLLIN, 0}, pollfd{rig, POLLIN, 0}};
    if (::poll(waits.data(), waits.size(), 20) <= 0) continue;
    if (waits[0].revents != 0) {
      const ssize_t got = ::recv(host, bytes.data(), bytes.size(), 0);
      open = got > 0 && write_all(rig, bytes.data(), static_cast<std::size_t>(got));
    }
    if (open && waits[1].revents != 0) {
      const ssize_t got = ::recv(rig, bytes.data(), bytes.size(), 0);
      if (got <= 0) break;
      const std::uint64_t before = passed_;
      const std::uint64_t pass = std::min(static_cast<std::uint64_t>(got), cut_at - before);
      if (flip_at >= before && flip_at - before < pass) bytes[flip_at - before] ^= 0x10;
      open = write_all(host, bytes.data(), pass) && before + pass < cut_at;
      passed_ = before + pass;
    }
  }
  ::close(rig);
}

}  // namespace nodal::crash
