// Frame sets for hosts that ask for one: heads' pictures by a lossless stream.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/calibration_keeper.h"
#include "firmware/client.h"
#include "firmware/config.h"
#include "firmware/frame_tap.h"
#include "firmware/publisher.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// One frame set at a time, for one host: what this costs the rig is one copy and the memory of one set, whoever asks
/// how often. A set that cannot be had within kPatience is not had; one that a host does not take within kSlowest is
/// taken from it.
///
/// Threading: thread-bound to control.
/// Ownership: keeps the memory of one set; the tap outlives it.
/// Errors: start()'s: kBusy, kNotReady; later ones end the stream: kOverload, kTimeout.
class FrameSender {
 public:
  FrameSender(const RigConfig& config, FrameTap& tap) : config_(config), tap_(tap) {}

  /// Opens the stream that the set will come on. `heads`: what each delivers.
  Result<StreamId> start(Client& client, const HeadShapes& heads, Instant now);
  /// True when it did something.
  bool step(const Clients& clients, Instant now);

  static constexpr Duration kPatience = Duration::seconds(3);
  static constexpr Duration kSlowest = Duration::seconds(120);

 private:
  struct Asked {
    std::uint64_t client = 0;
    StreamId stream = 0;
    Instant since;
    bool filled = false;
  };
  void send(Client& client, TappedSet set);

  const RigConfig config_;
  FrameTap& tap_;
  std::optional<Asked> asked_;
  Buffer memory_;
};

}  // namespace nodal::firmware
