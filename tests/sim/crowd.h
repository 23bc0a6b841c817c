// Hostile and good clients of one rig, and checks of the service for the good ones.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "firmware/rig.h"
#include "hal/sim/disk.h"
#include "tests/sim/good_client.h"
#include "tests/sim/hostile.h"

namespace nodal::swarm {

/// One episode's clients: a good one that stays, a new one every second, and up to 12 hostile ones of one or several
/// kinds, or up to 48 that only occupy slots. Meanwhile the good ones must be served; no set may be lost for lack of a
/// buffer or of time; live memory, the disk and the log must stay within limits.
///
/// Threading: thread-bound.
/// Ownership: refers to its arguments.
/// Errors: the oracle's.
class Crowd {
 public:
  Crowd(hal::sim::SimLinkListener& listener, Oracle& oracle, Documents& documents, Tally& tally, std::uint64_t seed,
        firmware::Rig& rig, hal::sim::SimDisk& disk, Instant now);

  /// The hostile clients connect.
  void attack();
  /// Steps the clients; the rig is stepped between two calls.
  void act(Instant now);
  void on_news(const std::vector<std::string>& sentences);
  void check(Instant now);
  /// All clients disconnect.
  void leave();
  /// Checks, after the rig has had time to drop them, that their resources are free again.
  void check_end();

  /// Bytes of this process's live heap.
  static std::uint64_t live_bytes();

  static constexpr int kMaxHostile = 12, kMaxThatOnlyAreThere = 48;
  /// Limit of the memory that 8 clients may cause, including the simulation's own side of their links.
  static constexpr std::uint64_t kMaxLiveBytes = 32U << 20;
  /// Limit of what may remain of it afterwards.
  static constexpr std::uint64_t kMaxLeftBytes = 512U << 10;
  /// Limit of the files' growth: the calibrations that a store keeps, settings, and files being written.
  static constexpr std::uint64_t kMaxFileBytes = 1U << 20;
  /// Limits of the log: bytes in a burst, and bytes per minute.
  static constexpr std::uint64_t kMaxNewsAtOnce = 32U << 10, kMaxNewsAMinute = 32U << 10;

 private:
  std::uint64_t sets_lost() const;

  Oracle& oracle_;
  Tally& tally_;
  hal::sim::SimLinkListener& listener_;
  const std::string torn_;
  hal::sim::Random random_;
  firmware::Rig& rig_;
  hal::sim::SimDisk& disk_;
  std::vector<std::unique_ptr<Hostile>> hostile_;
  std::vector<std::unique_ptr<GoodClient>> good_;
  std::string hostile_names_ = "nobody";
  const Instant since_;
  const std::uint64_t live_before_, lost_before_, free_before_;  ///< live heap, lost sets, free bytes of the disk
  std::uint64_t news_ = 0;
  Instant next_count_;
};

}  // namespace nodal::swarm
