// One client that means harm, or is careless: it loads the rig, and changes no setting of it.
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
  kSilent,        ///< connects and never says hello
  kIdle,          ///< says hello, then nothing
  kHalfOpen,      ///< sends half a frame, then nothing
  kSlowReader,    ///< pulls the newest raymaps and reads every 5 s what the link holds
  kSlowLossless,  ///< the same, lossless
  kGreedy,        ///< as many pulls, frame sets, uploads and streams as there may be, and never reads
  kFlooding,      ///< requests as fast as the rig takes them, with unknown fields and extreme values
  kLying,         ///< frames, credits and pieces that are wrong
  kJunk,          ///< uploads begun in a loop, and documents that are no calibrations
  kConnectStorm,  ///< connects and leaves, several times every 10 ms
};
inline constexpr int kHostileKinds = 10;
std::string_view name_of(HostileKind kind);

/// Connects again whenever the rig has dropped it.
///
/// Threading: thread-bound.
/// Ownership: owns its connection.
/// Errors: none; it does not care what the rig answers.
class Hostile {
 public:
  /// Makes a connection that holds few bytes on its way to the client, if that can be had; null when nobody listens.
  using Connect = std::function<std::unique_ptr<hal::LinkPort>(bool narrow)>;
  /// `torn`: a calibration document, to be torn and uploaded. `unknown_bytes`: of unknown fields, all in all.
  Hostile(HostileKind kind, Connect connect, std::string torn, std::uint64_t unknown_bytes, std::uint64_t seed);

  /// One turn; the swarm gives one every few milliseconds.
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
  std::uint64_t bytes_left_;               ///< of unknown fields
  std::optional<std::string> committing_;  ///< the SHA-256 of what is being uploaded
  StreamId uploading_ = 0;
};

}  // namespace nodal::swarm
