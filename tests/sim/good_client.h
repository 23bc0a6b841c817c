// A well-behaved client beside hostile ones; it measures how soon it is served.
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

/// Requests the status every second and pulls the newest raymaps; occasionally changes an exposure and uploads a
/// calibration. If the rig refuses or disconnects it, it retries, like nodal; it is served when it has its result, and
/// its waiting time counts from the first attempt. A visitor disconnects after every status and connects again as a new
/// client.
///
/// Threading: thread-bound.
/// Ownership: refers to its arguments.
/// Errors: reported to the oracle if the rig does not serve it within kServedWithin.
class GoodClient {
 public:
  GoodClient(hal::sim::SimLinkListener& listener, Oracle& oracle, Documents& documents, Tally& tally, bool visitor,
             std::uint64_t seed, Instant now);

  void pump(Instant now);
  /// Fails if a task has waited too long. `beside`: the other clients, for the message.
  void check(Instant now, const std::string& beside);

  static constexpr Duration kServedWithin = Duration::seconds(2);

 private:
  enum What : std::uint8_t { kStatus, kSetting, kUpload, kPull };
  static constexpr int kWhats = 4;
  /// A repeated request.
  struct Task {
    Duration every;                      ///< interval after its completion
    Instant due, next_try;               ///< `due`: time of the first attempt
    std::optional<std::uint64_t> asked;  ///< the request whose answer is pending
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
  std::size_t document_ = 0;                 ///< the one being uploaded
  std::optional<StreamId> uploading_;        ///< set while bytes of it are unsent
  std::optional<std::uint64_t> newest_set_;  ///< the newest set among the pulled raymaps
  wire::RaymapHeader raymap_;
  std::vector<std::uint8_t> pixels_;
};

}  // namespace nodal::swarm
