// A Unix socket in front of a rig's, which breaks or changes what the rig sends at a given byte.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

namespace nodal::crash {

/// Every connection to `path` is passed on to `rig`. cut_at() and flip_at() hold for the next connection only.
///
/// Threading: connections are served one after the other by a thread of its own.
/// Ownership: removes its socket.
/// Errors: throws std::runtime_error when the socket cannot be made.
class FaultyWire {
 public:
  FaultyWire(std::string path, std::string rig);
  ~FaultyWire();
  FaultyWire(const FaultyWire&) = delete;
  FaultyWire& operator=(const FaultyWire&) = delete;

  /// Ends the next connection after so many bytes of the rig.
  void cut_at(std::uint64_t byte) { cut_at_ = byte; }
  /// Inverts a bit of this byte of the next connection.
  void flip_at(std::uint64_t byte) { flip_at_ = byte; }
  /// Bytes of the rig that were passed on in the newest connection.
  std::uint64_t passed() const { return passed_; }

 private:
  void run();
  void serve(int host);

  static constexpr std::uint64_t kNever = ~std::uint64_t{0};
  const std::string path_, rig_;
  int listener_;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> cut_at_{kNever}, flip_at_{kNever}, passed_{0};
  std::thread thread_;
};

}  // namespace nodal::crash
