// The order in which hosts get what only one of them can have at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "firmware/hosts/access.h"

namespace nodal::firmware {

/// Hosts that wait for something exclusive, at most one entry for each. A party is a user at a socket; the next host is
/// chosen by these rules, the first that decides:
///
/// 1. A host that kMaxPassed later arrivals have passed is served before all others, so that nobody starves.
/// 2. Hosts at the control socket are served before those at the operate socket, and these before those at the
///    view-only socket.
/// 3. The party that was served least recently is served first, so that a user with many hosts gets no more than
///    another.
/// 4. Of its processes, the one that was served least recently.
/// 5. First come, first served.
///
/// So between a host's arrival and its turn there are at most as many turns as hosts were waiting, and kMaxPassed more.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class FairQueue {
 public:
  struct Host {
    std::uint64_t number = 0;
    Access access = Access::kView;
    std::optional<hal::PeerIdentity> identity{};  ///< user and process; nothing: unknown, as over a cable
  };

  /// The host must not be waiting yet.
  void add(const Host& host);
  /// Removes the host whose turn it is. Nothing when nobody waits.
  std::optional<std::uint64_t> next();
  /// The host has gone, or wants no turn any more.
  void leave(std::uint64_t host);

  bool waits(std::uint64_t host) const;
  bool empty() const { return waiting_.empty(); }
  std::size_t size() const { return waiting_.size(); }
  /// The highest access of the hosts that wait; nothing when nobody waits.
  std::optional<Access> highest() const;

  static constexpr std::size_t kMaxWaiting = 64;  ///< all links together are fewer
  static constexpr std::size_t kMaxPassed = 6;    ///< later arrivals that are served before a host
  static constexpr std::size_t kMaxParties = 64;  ///< and processes, whose last turn is known

 private:
  using Party = std::pair<Access, std::optional<std::uint32_t>>;
  using Process = std::pair<Party, std::int32_t>;
  struct Entry {
    Host host;
    std::size_t passed = 0;  ///< turns of hosts that arrived later
  };

  static Party party_of(const Entry& entry);
  static Process process_of(const Entry& entry);
  std::size_t choose() const;

  std::vector<Entry> waiting_;             ///< sorted by arrival
  std::map<Party, std::uint64_t> served_;  ///< number of each party's last turn
  std::map<Process, std::uint64_t> served_processes_;
  std::uint64_t turns_ = 0;
};

}  // namespace nodal::firmware
