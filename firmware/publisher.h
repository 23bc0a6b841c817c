#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/client.h"
#include "firmware/config.h"
#include "firmware/outlet.h"
#include "firmware/raymap.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// How long lossless pulls may hold the rig up: a token bucket, filled by time and emptied while the rig waits. One for
/// all clients, because what they cost everybody else adds up, and because a client would get a new one by connecting
/// again.
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: none.
class HoldBudget {
 public:
  /// Once a step, with whether the rig waited since the last. False when the time is used up.
  bool step(bool held, Instant now);

  static constexpr Duration kMost = Duration::seconds(1);  ///< a pause of a link or a disk that a recording survives
  static constexpr int kShare = 10;  ///< one tenth of the time at most: 27 of 30 raymaps a second are made all the same
  static constexpr Duration kLongestStep = Duration::milliseconds(100);  ///< a step that came later is this thread's doing

 private:
  Duration left_ = kMost;
  std::optional<Instant> last_;
};

/// Hands raymaps to the clients that pull, all from the same memory, which is free again when the last has sent it. A slow
/// client is given the newest it can take and told how many it missed; a lossless one holds the rig up until it has taken
/// its share, within HoldBudget: who holds the rig up when that is used up has its pull ended with an error, since what it
/// was promised cannot be kept.
///
/// Threading: thread-bound to control; the outlet's other end is the encoder's.
/// Ownership: sessions hold loans of the raymaps that they send.
/// Errors: start() says why a pull cannot begin.
class Publisher {
 public:
  Publisher(const RaymapConfig& config, Outlet<Raymap>& raymaps_in) : config_(config), raymaps_in_(raymaps_in) {}

  /// Opens the stream of a pull. Errors: kOverload when the client, or all together, have too many already.
  Result<StreamId> start(const Clients& clients, Client& client, const wire::PullRequest& request);
  /// Ends one after what is pending.
  Status stop(Client& client, StreamId stream);

  /// True when it did something.
  bool step(const Clients& clients, Instant now);
  /// Whether any client pulls JPEGs.
  static bool jpeg_wanted(const Clients& clients);
  /// Whether any client pulls pixels.
  static bool pixels_wanted(const Clients& clients);
  /// Whether any client pulls without loss: of what it is given, nothing may be shed.
  static bool lossless_wanted(const Clients& clients);
  /// Raymaps this client was not given, on all its streams.
  static std::uint64_t dropped(const Client& client);

  /// A lossless client has not taken its share yet.
  bool held_up() const { return held_up_; }
  /// The client that holds the rig up, or did last.
  const std::string& held_by() const { return held_by_; }
  std::uint64_t published() const { return published_; }  ///< raymaps given to at least one client
  std::uint64_t shed() const { return shed_; }  ///< raymaps that were not offered, for the board is overloaded

  static constexpr std::size_t kMaxPulls = 4;         ///< of a client
  /// Buffers that pulls may pin, of the blend's and the encoder's kMaxBuffers: a host that does not read keeps the one
  /// raymap that has begun to go out, a lossless pull kLosslessQueue. What is left is enough for the frame path.
  static constexpr std::size_t kMaxPinned = 16;
  static constexpr std::uint64_t kLosslessQueue = 2;  ///< raymaps that wait for a lossless client

 private:
  bool holds_up(const Client& client, const Pull& pull, StreamId stream) const;
  void end_holding(Client& client);
  bool offer(Client& client, const Raymap& raymap);
  BulkItem item(const Raymap& raymap, wire::PullRequest::Coding coding) const;
  static void forget_ended(Client& client);

  const RaymapConfig config_;
  Outlet<Raymap>& raymaps_in_;
  HoldBudget budget_;
  bool held_up_ = false;
  std::string held_by_;
  std::uint64_t published_ = 0;
  std::uint64_t shed_ = 0;
};

}  // namespace nodal::firmware
