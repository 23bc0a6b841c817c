// Sentences for the rig's log, sanitised and rate-limited, so that no host can forge a line or fill the disk.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// The subject of a sentence. Each kind has its own rate limit, so that too many of one kind suppress no other.
enum class NewsKind : std::uint8_t {
  kHosts,    ///< hosts that connected, left or were dropped
  kRig,      ///< states, calibrations, settings, the panel
  kChanges,  ///< the audit log
};
inline constexpr std::size_t kNewsKinds = 3;

/// One token bucket of bytes per kind: kBurstBytes at once, then kBytesASecond. Suppressed sentences are counted, and
/// at most every kSummaryEvery a sentence reports the count of a kind. So all kinds together write 24 KiB at once and
/// less than 32 KiB a minute. All text from hosts, files and devices enters the rig's log here, and every sentence
/// passes printable().
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: none.
class News {
 public:
  static constexpr std::int64_t kBurstBytes = 8 << 10;
  static constexpr std::int64_t kBytesASecond = 160;
  static constexpr std::int64_t kLineBytes = 40;  ///< bytes that the log adds to a sentence: time and level
  static constexpr Duration kSummaryEvery = Duration::seconds(10);
  static constexpr std::size_t kLongestSentence = 512;  ///< bytes; the rest is cut off

  explicit News(Instant now);

  /// Refills the buckets, and reports the suppressed sentences when that is due.
  void step(Instant now);
  void say(NewsKind kind, std::string_view sentence);
  /// The sentences since the last call.
  std::vector<std::string> take();

 private:
  struct Bucket {
    std::int64_t bytes = kBurstBytes;  ///< remaining; the last sentence may exceed them
    Instant filled;                    ///< the time up to which the bucket was refilled
    std::uint64_t left_out = 0;        ///< since `summed_up`
    Instant summed_up;
  };

  std::array<Bucket, kNewsKinds> buckets_;
  std::vector<std::string> sentences_;
};

}  // namespace nodal::firmware
