// Sends frame sets to hosts on request: the heads' pictures on a lossless stream.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/outlet.h"
#include "firmware/hosts/client.h"
#include "firmware/hosts/publisher.h"
#include "firmware/hosts/set_copy.h"
#include "firmware/picture/blender.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Serves one request at a time. So it costs the rig one copy and the memory of one set, however often hosts request a set.
/// The request fails if no set can be copied within kPatience. The host must read the set within kSlowest, and its link may
/// pause for kGrace at most; otherwise the stream ends, so that a host that does not read delays other hosts only briefly.
///
/// Threading: thread-bound to control.
/// Ownership: owns the memory of one set; the outlet and the blend outlive it.
/// Errors: start() returns kBusy, kNotReady; later errors end the stream: kOverload, kTimeout.
class FrameSender {
 public:
  FrameSender(const RigConfig& config, Outlet<SetLoan>& sets, Blender& blender)
      : config_(config), sets_(sets), blender_(blender) {}

  /// Opens the stream for the set. `heads`: the format of each head.
  Result<StreamId> start(Client& client, const HeadShapes& heads, Instant now);
  /// True when it did something.
  bool step(const Clients& clients, Instant now);

  static constexpr OutletSpec kSets{"frame-sets", OutletPolicy::kLatest, 1, 1};
  static constexpr Duration kPatience = Duration::seconds(3);
  static constexpr Duration kSlowest = Duration::seconds(120);  ///< ten heads of 2048x1024: 30 MB, at 250 KB/s
  static constexpr Duration kGrace = Duration::seconds(5);      ///< longest pause of a link
  static constexpr Duration kTurn = Duration::seconds(2);       ///< how long the turn of a host that got kBusy is kept

 private:
  struct Transfer {
    std::uint64_t client = 0;
    StreamId stream = 0;
    Instant since;
    SetCopy copy;
    bool copied = false;
    bool sent = false;
  };
  Client* receiver(const Clients& clients) const;
  void follow_adoptions();
  void send(Client& client);
  void end(const Clients& clients);
  bool keeps_pace(const Client& client, Instant now) const;

  const RigConfig config_;
  Outlet<SetLoan>& sets_;  ///< open while a set is requested and not copied yet
  Blender& blender_;
  std::optional<Blender::Adoption> in_force_, before_;  ///< the newest calibration of the blend, and the one before
  std::optional<Transfer> transfer_;
  std::uint64_t waiting_ = 0;  ///< the client that got kBusy first and is served next
  Instant waiting_until_;      ///< end of its turn, if it does not repeat its request
  std::shared_ptr<std::vector<std::uint8_t>> memory_;
};

}  // namespace nodal::firmware
