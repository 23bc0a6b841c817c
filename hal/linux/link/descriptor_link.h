#pragma once

#include <memory>
#include <optional>
#include <string>

#include "hal/link.h"
#include "hal/linux/link/socket_link.h"
#include "protocol/base/result.h"

namespace nodal::hal {

/// A descriptor that is closed at the end of its scope.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : fd_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept;
  int get() const { return fd_; }
  int release();

 private:
  int fd_;
};

/// Builds errors such as "unix:/run/nodal.sock: connection refused".
tl::unexpected<Error> system_error(Errc code, const std::string& where, int number);

/// A link over open descriptors: all of a socket link, and the base of a spawned program's link.
///
/// Threading: thread-bound to its stage.
/// Ownership: restores both descriptors' flags and closes them.
/// Errors: kLinkClosed, kIo.
class DescriptorLink : public LinkPort {
 public:
  /// Both descriptors may be the same; it is then closed once.
  DescriptorLink(Descriptor read_from, int write_to, std::string peer,
                 std::optional<PeerIdentity> identity = std::nullopt);
  ~DescriptorLink() override;
  DescriptorLink(const DescriptorLink&) = delete;
  DescriptorLink& operator=(const DescriptorLink&) = delete;

  Result<std::size_t> read(std::span<std::uint8_t> into) override;
  Result<std::size_t> write(std::span<const std::uint8_t> from) override;
  void add_wake_ups(WakeUps& to, bool to_read, bool to_write) const override;
  const std::string& peer() const override { return peer_; }
  std::optional<PeerIdentity> identity() const override { return identity_; }

 protected:
  /// The reason why the other end closed, if known.
  virtual std::string closed_because() { return "the other end closed the link"; }
  void close_descriptors();

 private:
  Descriptor read_;
  int write_;
  bool write_is_socket_ = false;
  int read_flags_ = 0;
  int write_flags_ = 0;
  std::string peer_;
  std::optional<PeerIdentity> identity_;
};

}  // namespace nodal::hal
