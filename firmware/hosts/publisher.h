#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/outlet.h"
#include "firmware/frame/raymap.h"
#include "firmware/hosts/admission.h"
#include "firmware/hosts/client.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// Sends raymaps to the clients that pull. All pulls share one copy of a raymap, which is released after the last pull
/// has sent it. No client delays the rig. A slow client gets the newest raymap that its link has room for, and the
/// number of missed ones. The backlog of a lossless pull is bounded in raymaps and bytes; when it would exceed a bound,
/// the pull ends with an error, and the raymaps sent until then have no gap.
///
/// Threading: thread-bound to control; the outlet's other end is the encoder's.
/// Ownership: sessions hold loans of the raymaps that they send. Errors: start()'s and stop()'s.
class Publisher {
 public:
  Publisher(const RaymapConfig& config, Outlet<Raymap>& raymaps_in) : config_(config), raymaps_in_(raymaps_in) {}

  /// Opens the stream of a pull. Errors: kOverload when the client, or all clients together, have too many pulls.
  Result<StreamId> start(const Clients& clients, Client& client, const wire::PullRequest& request);
  /// Ends a pull after its pending raymaps are sent. Errors: kNotFound.
  Status stop(Client& client, StreamId stream);

  /// True when it did something.
  bool step(const Clients& clients);
  /// Whether any client pulls JPEGs.
  static bool jpeg_wanted(const Clients& clients);
  /// Whether any client pulls pixels.
  static bool pixels_wanted(const Clients& clients);
  /// Whether any client pulls without loss, so that no raymap may be shed.
  static bool lossless_wanted(const Clients& clients);
  /// Raymaps that this client missed, on all its streams.
  static std::uint64_t dropped(const Client& client);
  /// The largest backlog of a lossless pull, in raymaps of this size.
  static std::size_t most_pending(std::size_t bytes);

  /// Sentences about lossless pulls that were ended, since the last call.
  std::vector<std::string> take_news() { return std::exchange(news_, {}); }
  std::uint64_t published() const { return published_; }  ///< raymaps given to at least one client
  std::uint64_t shed() const { return shed_; }  ///< raymaps that were not offered, because the board is overloaded

  static constexpr std::size_t kMaxPulls = 4;  ///< lossless pulls of one client
  /// Lossless pulls of all clients together, without the first pull of each.
  static constexpr std::size_t kMaxExtraPulls = 8;
  /// How many of the blend's and the encoder's kMaxBuffers pulls can hold for long: one per pull, because a host that
  /// does not read holds the one raymap that it has received in part.
  static constexpr std::size_t kMaxPinned = Admission::in_all(Admission::kMaxWorking) + kMaxExtraPulls;
  /// Bounds of a lossless pull's backlog: kLosslessBytes and kLosslessQueueItems raymaps, which is one second of JPEGs
  /// of ten heads, but at least kLosslessMin raymaps of any size. Lossless pulls share the raymaps in their backlogs,
  /// so all of them together need no more memory than this.
  static constexpr std::size_t kLosslessBytes = 24U << 20;
  static constexpr std::size_t kLosslessMin = 2;

 private:
  bool offer(Client& client, StreamId stream, Pull& pull, const Raymap& raymap);
  void end_lossless(Client& client, StreamId stream, Pull& pull, Error why);
  BulkItem item(const Raymap& raymap, wire::PullRequest::Coding coding) const;
  static void remove_ended(Client& client);

  const RaymapConfig config_;
  Outlet<Raymap>& raymaps_in_;
  std::vector<std::string> news_;
  std::uint64_t published_ = 0;
  std::uint64_t shed_ = 0;
};

}  // namespace nodal::firmware
