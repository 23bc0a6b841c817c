// A client that does as a host should beside hostile ones, and measures how soon it is served.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/sim/link.h"
#include "hal/sim/scene/random.h"
#include "tests/sim/host.h"
#include "tests/sim/line.h"
#include "tests/sim/oracle.h"

namespace nodal::swarm {

/// Asks for the status every second and pulls the newest raymaps; changes an exposure and uploads a calibration now and
/// then. When the rig refuses or drops it, it tries again, as nodal does; it is served when it has what it wanted, and
/// the time it waits counts from when it first wanted it. A visitor leaves after every status and comes back, each time
/// as a newcomer.
///
/// Threading: thread-bound.
/// Ownership: what it is given outlives it.
/// Errors: the oracle gets a failure when the rig did not serve it within kServedWithin.
class GoodClient {
 public:
  GoodClient(hal::sim::SimLinkListener& listener, Oracle& oracle, Documents& documents, Tally& tally, bool visitor,
             std::uint64_t seed, Instant now);

  void pump(Instant now);
  /// Fails when something has been wanted for too long. `beside`: among whom, for the message.
  void check(Instant now, const std::string& beside);

  static constexpr Duration kServedWithin = Duration::seconds(2);

 private:
  enum What : std::uint8_t { kStatus, kSetting, kUpload, kPull };
  static constexpr int kWhats = 4;
  /// Something that is wanted again and again.
  struct Task {
    Duration every;                      ///< after it was done
    Instant due, next_try;               ///< wanted since `due`
    std::optional<std::uint64_t> asked;  ///< the request that waits for its answer
  };

  void connect();
  void start(What what, Task& task);
  void take(const wire::Reply& reply, Instant now);
  void take_upload(const wire::Reply& reply, Task& task, Instant now);
  void take(const BulkPiece& piece, Instant now);
  void commit_when_sent();
  void done(What what, Instant now);
  void retry(Task& task, Instant now);

  hal::sim::SimLinkListener& listener_;
  Oracle& oracle_;
  Documents& documents_;
  Tally& tally_;
  const bool visitor_;
  hal::sim::Random random_;
  const bool lossless_;  ///< how it pulls
  std::unique_ptr<Line> line_;
  std::array<Task, kWhats> tasks_;
  std::uint64_t next_id_ = 1;
  std::size_t document_ = 0;                 ///< that is being uploaded
  std::optional<StreamId> uploading_;        ///< and not all of it is out
  std::optional<std::uint64_t> newest_set_;  ///< of the pull's raymaps
  wire::RaymapHeader raymap_;
  std::vector<std::uint8_t> pixels_;
};

}  // namespace nodal::swarm
