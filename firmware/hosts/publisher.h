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

/// Hands raymaps to the clients that pull, all from the same memory, which is free again when the last has sent it. No
/// client holds the rig up. A slow one is given the newest it can take and told how many it missed. A lossless pull may
/// fall behind by a bounded number of raymaps and bytes; when one more would exceed them its pull ends with an error, and
/// what it was given until then has no gap.
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
  bool step(const Clients& clients);
  /// Whether any client pulls JPEGs.
  static bool jpeg_wanted(const Clients& clients);
  /// Whether any client pulls pixels.
  static bool pixels_wanted(const Clients& clients);
  /// Whether any client pulls without loss: of what it is given, nothing may be shed.
  static bool lossless_wanted(const Clients& clients);
  /// Raymaps this client was not given, on all its streams.
  static std::uint64_t dropped(const Client& client);
  /// Raymaps of so many bytes that may wait for a lossless pull.
  static std::size_t may_wait(std::size_t bytes);

  /// Sentences about lossless pulls that were ended, since the last call.
  std::vector<std::string> take_news() { return std::exchange(news_, {}); }
  std::uint64_t published() const { return published_; }  ///< raymaps given to at least one client
  std::uint64_t shed() const { return shed_; }  ///< raymaps that were not offered, for the board is overloaded

  static constexpr std::size_t kMaxPulls = 4;       ///< of a client
  static constexpr std::size_t kMaxExtraPulls = 8;  ///< of all clients, beside the first of each
  /// Buffers that pulls may pin, of the blend's and the encoder's kMaxBuffers: a host that does not read keeps the one
  /// raymap that has begun to go out.
  static constexpr std::size_t kMaxPinned = Admission::in_all(Admission::kMaxWorking) + kMaxExtraPulls;
  /// A lossless pull may fall behind by so much, and by kLosslessQueueItems raymaps: a second of JPEGs of ten heads. By
  /// kLosslessLeast it always may. Lossless pulls that wait for the same raymaps share them, so this is what all of them
  /// cost together.
  static constexpr std::size_t kLosslessBytes = 24U << 20;
  static constexpr std::size_t kLosslessLeast = 2;

 private:
  bool offer(Client& client, StreamId stream, Pull& pull, const Raymap& raymap);
  void end_lossless(Client& client, StreamId stream, Pull& pull, Error why);
  BulkItem item(const Raymap& raymap, wire::PullRequest::Coding coding) const;
  static void forget_ended(Client& client);

  const RaymapConfig config_;
  Outlet<Raymap>& raymaps_in_;
  std::vector<std::string> news_;
  std::uint64_t published_ = 0;
  std::uint64_t shed_ = 0;
};

}  // namespace nodal::firmware
