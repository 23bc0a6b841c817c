// The least progress of a rig that counts as progress. Without it, a rig that sends a byte a minute would renew every
// wait.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "protocol/base/units.h"

namespace nodal::host {

/// Bytes that must move in a window, unless what is waited for is complete sooner. With the usual --timeout of 10 s
/// this is 1.6 kB/s, less than any link that a rig is reached by.
inline constexpr std::uint64_t kMinBytesAWindow = 16 * 1024;

/// Divides a wait into half windows. Each must move half of `bytes`; the wait has stalled after two in a row that
/// did not. One alone may be a pause of this program itself, such as Ctrl-Z. What moves must be counted byte by byte:
/// at the floor, a frame of the protocol takes longer than a window.
///
/// Threading: thread-bound.
/// Ownership: none; the caller passes the time, of any one clock.
/// Errors: none.
class ProgressFloor {
 public:
  ProgressFloor(Duration window, Duration now, std::uint64_t bytes = kMinBytesAWindow)
      : window_(window), least_(bytes), begun_(now) {}

  void moved(std::uint64_t bytes, Duration now) {
    bytes_ += bytes;
    if (bytes_ >= least_ / 2) restart(now);
  }
  /// The same by a count that only rises, such as RigConnection::received(). True when it has risen.
  bool moved_to(std::uint64_t total, Duration now) {
    if (total <= total_) return false;
    moved(total - std::exchange(total_, total), now);
    return true;
  }
  /// Begins a new window, because something complete arrived.
  void restart(Duration now) {
    begun_ = now;
    bytes_ = 0;
    missed_ = 0;
  }
  bool stalled(Duration now) {
    if (now - begun_ >= window_ / 2) {
      begun_ = now;
      bytes_ = 0;
      ++missed_;
    }
    return missed_ >= 2;
  }
  /// Until the end of the present half.
  Duration left(Duration now) const { return begun_ + window_ / 2 - now; }
  Duration window() const { return window_; }

 private:
  Duration window_;
  std::uint64_t least_;
  Duration begun_;
  std::uint64_t bytes_ = 0;
  std::uint64_t total_ = 0;
  int missed_ = 0;
};

/// The same for a request that the rig works on: its activity ("compiling the table …: 40 %") must change within
/// kSameActivity, and the request must be answered within kLongestRequest.
///
/// Threading, Ownership, Errors: as ProgressFloor.
class ActivityFloor {
 public:
  static constexpr Duration kSameActivity = Duration::seconds(300);
  static constexpr Duration kLongestRequest = Duration::seconds(3600);

  explicit ActivityFloor(Duration now) : begun_(now), changed_(now) {}

  void see(std::string_view activity, Duration now) {
    if (activity == activity_) return;
    activity_ = activity;
    changed_ = now;
  }
  bool stalled(Duration now) const { return now - changed_ >= kSameActivity || now - begun_ >= kLongestRequest; }
  Duration since_begun(Duration now) const { return now - begun_; }

 private:
  Duration begun_;
  Duration changed_;
  std::string activity_;
};

}  // namespace nodal::host
