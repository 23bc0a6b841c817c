// Sentences for the rig's log, sanitised and rate-limited: nobody who talks to the rig can forge a line or fill a disk.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// What a sentence is about. Each kind has an allowance of its own, so that one kind in excess hides no other.
enum class NewsKind : std::uint8_t {
  kHosts,    ///< hosts that came, left or were dropped
  kRig,      ///< states, calibrations, settings, the panel
  kChanges,  ///< the audit log
};
inline constexpr std::size_t kNewsKinds = 3;

/// A token bucket of bytes for each kind: kBurstBytes at once, then kBytesASecond. What is left out is counted, and a
/// sentence says how many of which kind, at most every kSummaryEvery. So all kinds together write 24 KiB at once and less
/// than 32 KiB a minute. Every sentence passes printable() here, which makes this the one place where text from hosts,
/// files and devices enters the rig's log.
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: none.
class News {
 public:
  static constexpr std::int64_t kBurstBytes = 8 << 10;
  static constexpr std::int64_t kBytesASecond = 160;
  static constexpr std::int64_t kLineBytes = 40;  ///< what the log adds to a sentence: time and level
  static constexpr Duration kSummaryEvery = Duration::seconds(10);
  static constexpr std::size_t kLongestSentence = 512;  ///< bytes; the rest is cut off

  explicit News(Instant now);

  /// Refills the buckets, and says what was left out when that is due.
  void step(Instant now);
  void say(NewsKind kind, std::string_view sentence);
  /// The sentences since the last call.
  std::vector<std::string> take();

 private:
  struct Bucket {
    std::int64_t bytes = kBurstBytes;  ///< that may be said; the last sentence may exceed them
    Instant filled;                    ///< up to here bytes have been given
    std::uint64_t left_out = 0;        ///< since `summed_up`
    Instant summed_up;
  };

  std::array<Bucket, kNewsKinds> buckets_;
  std::vector<std::string> sentences_;
};

}  // namespace nodal::firmware
