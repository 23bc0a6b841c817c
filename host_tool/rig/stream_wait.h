// Waits for the events of one stream, with a floor of progress.
#pragma once

#include <string>

#include "host_tool/rig/progress_floor.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// Threading: thread-bound.
/// Ownership: refers to the connection.
/// Errors: RigConnection::next_event()'s; kTimeout if the stream brings less than kMinBytesAWindow in `window`. Bytes
///   of an incomplete piece count, too.
class StreamWait {
 public:
  /// `what` is expected, and named in errors.
  StreamWait(RigConnection& rig, StreamId stream, Duration window, std::string what)
      : rig_(rig), stream_(stream), floor_(window, rig.now()), what_(std::move(what)) {}

  /// The next event. Only bytes of this stream's items count as progress.
  Result<Event> next();
  /// Begins a new window, because what arrived has no bytes.
  void restart() { floor_.restart(rig_.now()); }

 private:
  RigConnection& rig_;
  StreamId stream_;
  ProgressFloor floor_;
  std::string what_;
};

}  // namespace nodal::host
