// Frame sets for hosts that ask for one: heads' pictures by a lossless stream.
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

/// One frame set at a time, for one host: what this costs the rig is one copy and the memory of one set, whoever asks
/// how often. A set that cannot be had within kPatience is not had. A host must read the set within kSlowest and
/// its link may pause for kGrace at most; otherwise the stream ends, so that a host that does not read delays the others
/// only briefly.
///
/// Threading: thread-bound to control.
/// Ownership: keeps the memory of one set; the outlet and the blend outlive it.
/// Errors: start()'s: kBusy, kNotReady; later ones end the stream: kOverload, kTimeout.
class FrameSender {
 public:
  FrameSender(const RigConfig& config, Outlet<SetLoan>& sets, Blender& blender)
      : config_(config), sets_(sets), blender_(blender) {}

  /// Opens the stream that the set will come on. `heads`: what each delivers.
  Result<StreamId> start(Client& client, const HeadShapes& heads, Instant now);
  /// True when it did something.
  bool step(const Clients& clients, Instant now);

  static constexpr OutletSpec kSets{"frame-sets", OutletPolicy::kLatest, 1, 1};
  static constexpr Duration kPatience = Duration::seconds(3);
  static constexpr Duration kSlowest = Duration::seconds(120);  ///< ten heads of 2048x1024: 30 MB, at 250 KB/s
  static constexpr Duration kGrace = Duration::seconds(5);      ///< a link may pause for so long
  static constexpr Duration kTurn = Duration::seconds(2);       ///< a host that was told kBusy has so long to ask again

 private:
  struct Asked {
    std::uint64_t client = 0;
    StreamId stream = 0;
    Instant since;
    SetCopy copy;
    bool copied = false;
    bool sent = false;
  };
  Client* asking_client(const Clients& clients) const;
  void follow_adoptions();
  void send(Client& client);
  void end(const Clients& clients);
  bool keeps_pace(const Client& client, Instant now) const;

  const RigConfig config_;
  Outlet<SetLoan>& sets_;  ///< open while a set is asked for and not copied yet
  Blender& blender_;
  std::optional<Blender::Adoption> in_force_, before_;  ///< the newest calibration of the blend, and the one before
  std::optional<Asked> asked_;
  std::uint64_t waiting_ = 0;  ///< the client that was told kBusy first: it is the next
  Instant waiting_until_;      ///< unless it does not ask again
  std::shared_ptr<std::vector<std::uint8_t>> memory_;
};

}  // namespace nodal::firmware
