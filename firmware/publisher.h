#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "firmware/client.h"
#include "firmware/config.h"
#include "firmware/outlet.h"
#include "firmware/raymap.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

using Clients = std::vector<std::unique_ptr<Client>>;

/// Hands raymaps to the clients that pull, all from the same memory, which is free again when the last has sent it. A slow client is given the newest it can take and told how many it missed; a lossless one holds the
/// rig up until it has taken its share, for at most kPatience without a sign of life.
///
/// Threading: thread-bound to control; the outlet's other end is the encoder's.
/// Ownership: sessions hold loans of the raymaps that they send.
/// Errors: start() says why a pull cannot begin.
class Publisher {
 public:
  Publisher(const RaymapConfig& config, Outlet<Raymap>& raymaps_in) : config_(config), raymaps_in_(raymaps_in) {}

  /// Opens the stream of a pull. Errors: kOverload when the client has too many already.
  Result<StreamId> start(Client& client, const wire::PullRequest& request);
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
  std::uint64_t published() const { return published_; }  ///< raymaps given to at least one client
  std::uint64_t shed() const { return shed_; }  ///< raymaps that were not offered, for the board is overloaded

  static constexpr std::size_t kMaxPulls = 4;         ///< of a client
  static constexpr std::uint64_t kLosslessQueue = 2;  ///< raymaps that wait for a lossless client
  static constexpr Duration kPatience = Duration::seconds(10);

 private:
  bool holds_up(Client& client, Instant now);
  bool offer(Client& client, const Raymap& raymap);
  BulkItem item(const Raymap& raymap, wire::PullRequest::Coding coding) const;
  static void forget_ended(Client& client);

  const RaymapConfig config_;
  Outlet<Raymap>& raymaps_in_;
  bool held_up_ = false;
  std::uint64_t published_ = 0;
  std::uint64_t shed_ = 0;
};

}  // namespace nodal::firmware
