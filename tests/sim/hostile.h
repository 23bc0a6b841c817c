// A hostile or careless client: it loads the rig, but changes no setting.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "hal/link.h"
#include "hal/sim/scene/random.h"
#include "tests/sim/line.h"

namespace nodal::swarm {

enum class HostileKind : std::uint8_t {
  kSilent,        ///< connects and never sends a Hello
  kIdle,          ///< sends a Hello, then nothing
  kHalfOpen,      ///< sends half a frame, then nothing
  kSlowReader,    ///< pulls the newest raymaps and reads the link's content every 5 s
  kSlowLossless,  ///< the same, lossless
  kGreedy,        ///< as many pulls, frame sets, uploads and streams as allowed, and never reads
  kFlooding,      ///< requests as fast as the rig accepts them, with unknown fields and extreme values
  kLying,         ///< invalid frames, credits and pieces
  kJunk,          ///< begins uploads in a loop, and uploads documents that are not calibrations
  kConnectStorm,  ///< connects and disconnects, several times every 10 ms
};
inline constexpr int kHostileKinds = 10;
std::string_view name_of(HostileKind kind);

/// Reconnects whenever the rig has dropped it.
///
/// Threading: thread-bound.
/// Ownership: owns its connection.
/// Errors: none; it ignores the rig's answers.
class Hostile {
 public:
  /// Makes a connection, if possible one that buffers only few bytes towards the client; null if nothing listens.
  using Connect = std::function<std::unique_ptr<hal::LinkPort>(bool narrow)>;
  /// `torn`: a calibration document, of which a part is uploaded. `unknown_bytes`: total of unknown fields.
  Hostile(HostileKind kind, Connect connect, std::string torn, std::uint64_t unknown_bytes, std::uint64_t seed);

  /// One step; the swarm calls it every few milliseconds.
  void act(Instant now);
  HostileKind kind() const { return kind_; }

 private:
  void connect(Instant now);
  void begin();
  void go_on(Instant now);
  void read_all();
  void send_half_a_frame();
  void pull(bool lossless, int times);
  void take_everything();
  void flood();
  void send_invalid_frame();
  void upload_junk();
  wire::Request useless_request();
  wire::Request extreme_request();

  const HostileKind kind_;
  const Connect connect_;
  const std::string torn_;
  hal::sim::Random random_;
  std::unique_ptr<Line> line_;
  Instant next_connect_, next_turn_;
  std::uint64_t next_id_ = 1;
  std::uint64_t bytes_left_;               ///< remaining bytes of unknown fields
  std::optional<std::string> committing_;  ///< the SHA-256 of the document being uploaded
  StreamId uploading_ = 0;
};

}  // namespace nodal::swarm
