// Reads a flight record, record by record.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>

#include "firmware/capture/capture_log.h"
#include "firmware/flight/flight_codec.h"
#include "protocol/base/result.h"
#include "protocol/framing.h"

namespace nodal::flight {

/// Threading: thread-bound.
/// Ownership: the bytes outlive it.
/// Errors: kTruncated if not even the first record is whole, kFutureVersion, kBadFormat; each names the file and the
/// record.
class FlightReader {
 public:
  /// Reads the first record. `name`: of the file, for errors.
  static Result<FlightReader> open(std::span<const std::uint8_t> bytes, const std::string& name);

  struct Begin {
    std::string software;
    std::size_t sets_held = 0;
    bool trigger = false;
  };
  const Begin& begin() const { return begin_; }

  /// The events of the next step, its StepBegun first; empty at the end. A step whose end is not in the record is not
  /// returned, because its last events may be missing.
  Result<std::deque<firmware::CaptureEvent>> next_step();

  /// Why the record ended; empty: it was cut off.
  const std::string& ended() const { return ended_; }

  /// A step has less, even with 256 pulses and 8 frames of every head.
  static constexpr std::size_t kMaxEventsInStep = 4096;
  static constexpr std::size_t kMaxSetsHeld = 256;

 private:
  FlightReader(std::span<const std::uint8_t> bytes, std::string name) : rest_(bytes), name_(std::move(name)) {}
  /// False at the end of what is whole.
  Result<bool> read_record();
  Status add(const take::flight::Record& record);

  std::span<const std::uint8_t> rest_;
  std::string name_;
  FrameDecoder frames_;
  firmware::FlightDecoder decoder_;
  std::deque<firmware::CaptureEvent> events_;
  Begin begin_;
  std::string ended_;
};

}  // namespace nodal::flight
