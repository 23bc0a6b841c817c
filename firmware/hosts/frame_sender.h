// Sends frame sets to hosts on request: the heads' pictures on a lossless stream.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/outlet.h"
#include "firmware/hosts/client.h"
#include "firmware/hosts/publisher.h"
#include "firmware/hosts/set_copy.h"
#include "firmware/hosts/stream_progress.h"
#include "firmware/picture/blender.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Sends up to kMaxCopies sets at once, each to another host, so that memory is bounded however often hosts ask;
/// further requests wait for their turn (FairQueue). The hosts that ask at the same time get copies of one set.
///
/// A host keeps its copy until it has all of it, however slowly it reads; one that reads nothing loses it
/// (StreamProgress). While another host waits and no copy is free, the longest transfer ends that has had its share,
/// kShare; one of a control host ends for a view-only host after kShareBeforeView. A host that loses its copy is
/// disconnected, because its session holds the copy until then. The request fails if no set can be copied within
/// kPatience.
///
/// Threading: thread-bound to control.
/// Ownership: owns the memory of kMaxCopies sets; the outlet and the blend outlive it.
/// Errors: start() returns kNotReady; later errors end the stream: kOverload, or the conversation: kTimeout.
class FrameSender {
 public:
  FrameSender(const RigConfig& config, Outlet<SetLoan>& sets, Blender& blender)
      : config_(config), sets_(sets), blender_(blender) {}

  /// Whether a copy is free for another request.
  bool has_room() const { return free_copy() != nullptr; }
  /// Opens the stream for the set. Only while has_room(). `heads`: the format of each head; `period`:
  /// of the frame rate in force.
  Result<StreamId> start(Client& client, const HeadShapes& heads, Duration period, Instant now);
  /// True when it did something. `waiting`: the highest access of the hosts that wait for their turn.
  bool step(const Clients& clients, std::optional<Access> waiting, Instant now);

  static constexpr OutletSpec kSets{"frame-sets", OutletPolicy::kLatest, 1, 1};
  static constexpr FrameTime kPatience{Duration::seconds(3), 6};
  static constexpr std::size_t kMaxCopies = 3;
  static constexpr Duration kShare = Duration::seconds(2);
  static constexpr Duration kShareBeforeView = Duration::seconds(5);

 private:
  struct Transfer {
    std::uint64_t client = 0;
    Access access = Access::kView;
    StreamId stream = 0;
    Instant since;  ///< when it began to wait for a set; when sent: to be sent
    Duration patience;
    SetCopy set;
    bool copied = false;
    std::optional<StreamProgress> sent{};  ///< once it is being sent
  };
  using Memory = std::shared_ptr<std::vector<std::uint8_t>>;
  /// Memory for the copy of a set. A session may hold it for longer than the transfer.
  struct Copy {
    Memory memory;
    std::optional<Transfer> transfer;
    bool free() const { return !transfer && memory.use_count() <= 1; }
  };
  const Copy* free_copy() const;
  Client* receiver(const Clients& clients, const Transfer& transfer) const;
  void follow_adoptions();
  bool take_set();
  bool step(Copy& copy, const Clients& clients, Instant now);
  bool end_longest(const Clients& clients, std::optional<Access> waiting, Instant now);
  void send(Client& client, const SetCopy& set, StreamId stream);
  void end(Copy& copy, const Clients& clients);

  const RigConfig config_;
  Outlet<SetLoan>& sets_;  ///< open while a set is requested and not copied yet
  Blender& blender_;
  std::optional<Adoption> in_force_, before_;  ///< the newest calibration of the blend, and the one before
  std::array<Copy, kMaxCopies> copies_;
};

}  // namespace nodal::firmware
