// Two ends of a byte stream in memory, with faults for tests.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>

#include "hal/link.h"
#include "protocol/base/result.h"

namespace nodal::hal::sim {

/// One direction of a simulated link, shared by its writer, its reader and the test.
struct LinkPipe {
  std::deque<std::uint8_t> bytes;
  std::size_t capacity = 256U << 10;  ///< beyond it a writer gets 0, as with a full socket
  bool writer_gone = false;
  bool reader_gone = false;
  bool reset = false;                     ///< bytes in transit are lost and both ends return kLinkClosed
  bool stalled = false;                   ///< the reader gets nothing, as with a slow or stuck peer
  std::uint32_t split = 0;                ///< if not 0: every read and write moves 1..split bytes, at random
  std::optional<std::uint64_t> flip_bit;  ///< flips this bit, counted from the next byte written
  std::uint64_t written = 0;
  std::minstd_rand random;
};

/// One end.
class SimLink final : public LinkPort {
 public:
  SimLink(std::shared_ptr<LinkPipe> in, std::shared_ptr<LinkPipe> out, std::string peer,
          std::optional<PeerIdentity> identity = std::nullopt);
  ~SimLink() override;
  SimLink(const SimLink&) = delete;
  SimLink& operator=(const SimLink&) = delete;

  // What the program uses.
  Result<std::size_t> read(std::span<std::uint8_t> into) override;
  Result<std::size_t> write(std::span<const std::uint8_t> from) override;
  void add_wake_ups(WakeUps& to, bool to_read, bool to_write) const override;
  const std::string& peer() const override { return peer_; }
  std::optional<PeerIdentity> identity() const override { return identity_; }

  // What the test uses. "in" is the direction that this end reads, "out" the one that it writes.
  LinkPipe& in() { return *in_; }
  LinkPipe& out() { return *out_; }
  /// As if the cable were pulled: bytes in transit are lost.
  void reset();

 private:
  std::shared_ptr<LinkPipe> in_;
  std::shared_ptr<LinkPipe> out_;
  std::string peer_;
  std::optional<PeerIdentity> identity_;
};

/// Two connected ends.
std::pair<std::unique_ptr<SimLink>, std::unique_ptr<SimLink>> make_link_pair(std::string a_sees = "sim:b",
                                                                             std::string b_sees = "sim:a");

/// A listener that a test connects to.
class SimLinkListener final : public LinkListenerPort {
 public:
  Result<std::unique_ptr<LinkPort>> accept() override;
  /// At once while a peer waits. Nothing else can be known beforehand: the same thread runs the peers.
  void add_wake_ups(WakeUps& to) const override {
    if (!knocking_.empty()) to.at(Instant());
  }

  /// Returns the host's end of a new link; the listener will accept the other end, whose peer is this process.
  std::unique_ptr<SimLink> connect(PeerIdentity host = {1000, 4711});

 private:
  std::deque<std::unique_ptr<SimLink>> knocking_;
  std::uint64_t count_ = 0;
};

}  // namespace nodal::hal::sim
