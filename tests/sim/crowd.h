// Hostile clients and good ones at one rig, and what the rig owes the good ones.
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

/// One episode's clients: a good one that stays, a newcomer every second, and up to 12 hostile ones of one kind or of
/// several, or up to 48 that only take places. While they are there: the good ones are served; no set is lost for want of a
/// buffer or of time; live memory, the disk and the log are bounded.
///
/// Threading: thread-bound.
/// Ownership: what it is given outlives it.
/// Errors: the oracle's.
class Crowd {
 public:
  Crowd(hal::sim::SimLinkListener& listener, Oracle& oracle, Documents& documents, Tally& tally, std::uint64_t seed,
        firmware::Rig& rig, hal::sim::SimDisk& disk, Instant now);

  /// The hostile ones come.
  void attack();
  /// The clients' turn; the rig's own comes between two.
  void act(Instant now);
  void on_news(const std::vector<std::string>& sentences);
  void check(Instant now);
  /// All clients go.
  void leave();
  /// When the rig has had time to drop them: what they cost has been given back.
  void check_end();

  /// Bytes of live heap in this process.
  static std::uint64_t live_bytes();

  static constexpr int kMostHostile = 12, kMostThatOnlyAreThere = 48;
  /// What 8 clients may make the rig hold while they are there, with the simulation's own side of their links.
  static constexpr std::uint64_t kMostLiveBytes = 32U << 20;
  /// What may remain of it afterwards.
  static constexpr std::uint64_t kMostLeftBytes = 512U << 10;
  /// What the files may grow by: the calibrations that a store keeps, settings, and what is being written.
  static constexpr std::uint64_t kMostFileBytes = 1U << 20;
  /// Bytes of log: so many at once, and so many a minute beside.
  static constexpr std::uint64_t kMostNewsAtOnce = 32U << 10, kMostNewsAMinute = 32U << 10;

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
