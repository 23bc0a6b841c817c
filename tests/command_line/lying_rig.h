// A rig that sends whatever a test wants: valid frames with wrong content.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/link.h"
#include "hal/linux/link/socket_link.h"
#include "protocol/bulk.h"
#include "protocol/framing.h"
#include "protocol/nodal.pb.h"

namespace nodal::command_line {

/// Listens on a Unix socket and serves one host at a time, frame by frame, without a session's checks.
///
/// Threading: thread-bound; step() does the pending work.
/// Ownership: the destructor removes the socket.
/// Errors: none; a host that disconnects is dropped.
class LyingRig {
 public:
  explicit LyingRig(const std::string& socket);
  virtual ~LyingRig() = default;
  LyingRig(const LyingRig&) = delete;
  LyingRig& operator=(const LyingRig&) = delete;

  void step();

 protected:
  /// Answers a request; it may send any frames.
  virtual void on(const wire::Request& request) = 0;

  void reply(const wire::Request& request, wire::Reply reply);
  /// Answers a request about the genlock with 30 frames a second, from which a host makes its deadlines.
  void reply_rate(const wire::Request& request);
  void frame(FrameType type, StreamId stream, const std::string& payload);
  void open_stream(StreamId stream, StreamPolicy policy);
  /// Sends the first piece of an item: it announces `total` bytes of body, and contains `body`.
  void first_piece(StreamId stream, std::uint64_t item, const std::string& meta, std::uint64_t total,
                   const std::string& body);

  wire::Hello hello;
  /// Bytes that the host has not taken yet.
  std::size_t waiting() const { return out_.size(); }

 private:
  void greet();

  std::unique_ptr<hal::LinkListenerPort> listener_;
  std::unique_ptr<hal::LinkPort> link_;
  std::unique_ptr<FrameDecoder> decoder_;
  std::uint32_t sequence_ = 0;
  std::vector<std::uint8_t> out_;
};

/// A raymap's header as the meta of its item.
std::string raymap_meta(std::uint32_t width, std::uint32_t height, const std::string& coding);

}  // namespace nodal::command_line
