// Distinguishes a host that reads slowly from one that reads nothing.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/bulk.h"

namespace nodal::firmware {

/// The progress of one stream to a host, by the bytes of its items that the link has taken. Bytes of other streams and
/// of replies do not count, because a host may read them and give this stream no credit.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class StreamProgress {
 public:
  /// A stream that makes no progress for this time is ended. A Unix socket frees its buffer 36 kB at a time, so a host
  /// that reads 1 kB/s makes progress every 37 s; an SSH connection passes on packets of up to 32 KiB.
  static constexpr Duration kLongestPause = Duration::seconds(60);

  explicit StreamProgress(Instant now) : moved_(now) {}

  /// Call it in each step. Whether the link has taken nothing for kLongestPause while items waited.
  bool stalled(const StreamCounts& counts, Instant now) {
    if (counts.pending == 0 || counts.bytes != bytes_) moved_ = now;
    bytes_ = counts.bytes;
    return now - moved_ > kLongestPause;
  }
  static Error error(const std::string& what) {
    return {Errc::kTimeout, fmt::format("this host has read nothing of {} for {} s", what, kLongestPause.ms() / 1000)};
  }

 private:
  std::uint64_t bytes_ = 0;
  Instant moved_;  ///< when `bytes_` last changed, or nothing waited
};

}  // namespace nodal::firmware
