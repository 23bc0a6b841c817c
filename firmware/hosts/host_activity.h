// When bytes moved between the rig and a host, and the deadlines of a connection.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/session.h"

namespace nodal::firmware {

/// Threading: thread-bound to control.
/// Ownership: none; the session is read only during a call.
/// Errors: overdue()'s.
class HostActivity {
 public:
  /// The host has connected.
  explicit HostActivity(Instant now)
      : since_(now), used_(now), received_at_(now), moved_(now), pinged_(now), frame_since_(now) {}

  static constexpr Duration kHelloWithin = Duration::seconds(2);  ///< from the connection to the hello
  /// The deadline of a protocol frame, from its first byte to its last: this, and one second more for each
  /// kSlowestBytes of it that have arrived (a bulk frame has 64 KiB). It allows a slow link, and not one that has
  /// stopped.
  static constexpr Duration kFrameWithin = Duration::seconds(10);
  static constexpr std::size_t kSlowestBytes = 512;
  /// A host whose streams' own bytes do not move for this time is closed when another needs its place.
  static constexpr Duration kStalledAfter = Duration::seconds(10);
  /// A silent host is pinged, and closed when it does not answer. Long, because `nodal` may compute between requests. A
  /// host whose streams move is not silent: its pong comes after it has read all that its link holds.
  static constexpr Duration kPingEvery = Duration::seconds(30);
  static constexpr Duration kSilentFor = Duration::seconds(300);
  /// Longest silence of a host with temporary settings; it is pinged before.
  static constexpr Duration kLeaseSilent = Duration::seconds(10);
  static constexpr Duration kLeasePingEvery = kLeaseSilent / 4;

  /// A hello resets the idle time, and so does a request.
  void on_hello(Instant now) { used_ = now; }
  void on_request(Instant now) {
    used_ = now;
    has_requested_ = true;
  }
  /// It opened a stream for an upload.
  void on_upload(Instant now) { moved_ = now; }
  /// Bytes came over the link. Call it before the session receives them, and then on_received().
  void on_read(std::size_t bytes, const Session& session, Instant now) {
    bytes_in_ += bytes;
    received_at_ = now;
    begins_frame_ = session.bytes_under_way() == 0;
  }
  void on_written(std::size_t bytes) { bytes_out_ += bytes; }
  /// The session received these bytes.
  void on_received(const Session& session, Instant now);
  /// The session gave bytes to the link.
  void on_moved(const Session& session, Instant now);
  /// The deadline that has passed, if any.
  std::optional<Error> overdue(const Session& session, Instant now) const;
  /// Whether to ping the host now; then the next ping comes later. `leases`: it may have temporary settings.
  bool ping_due(bool leases, Instant now);

  Instant since() const { return since_; }
  /// When it last sent a request, or bytes of its streams and uploads last moved.
  Instant idle_since() const { return used_; }
  /// How long nothing was received from it.
  Duration silence(Instant now) const { return now - received_at_; }
  /// Bytes of its streams and uploads have not moved for long.
  bool stalled(Instant now) const { return now - moved_ >= kStalledAfter; }
  bool has_requested() const { return has_requested_; }
  std::uint64_t bytes_in() const { return bytes_in_; }
  std::uint64_t bytes_out() const { return bytes_out_; }

 private:
  const Instant since_;
  Instant used_;
  bool has_requested_ = false;
  Instant received_at_;     ///< when bytes were last received
  Instant moved_;           ///< when bytes of its streams and uploads last moved
  std::uint64_t bulk_ = 0;  ///< so many bytes of them had moved then
  Instant pinged_;
  Instant frame_since_;        ///< when the first byte of the current protocol frame arrived
  std::uint32_t frames_ = 0;   ///< frames_received() when frame_since_ was set
  bool begins_frame_ = false;  ///< the newest bytes begin a frame
  std::uint64_t bytes_in_ = 0;
  std::uint64_t bytes_out_ = 0;
};

}  // namespace nodal::firmware
