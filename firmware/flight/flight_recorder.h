// The flight recorder: capture's events on their way to the disk's stage, and the records since nodald was started.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware/capture/capture_log.h"
#include "firmware/config/config.h"
#include "firmware/flight/flight_codec.h"
#include "firmware/flight/logged_ports.h"
#include "protocol/base/spsc_ring.h"
#include "protocol/take/flight.pb.h"

namespace nodal::firmware {

/// Capture's end. An event for which there is no room ends the record, because what comes after a gap cannot be
/// repeated.
///
/// Threading: thread-bound to capture, except for next() and overrun(), which the disk's stage calls.
/// Ownership: the ports outlive it; it outlives capture.
/// Errors: none.
class FlightRecorder final : public CaptureLog {
 public:
  FlightRecorder(const RigConfig& config, hal::HeadEnumerator& heads, hal::TriggerPort* trigger);

  /// The ports to give to capture.
  hal::HeadEnumerator& heads() { return heads_; }
  hal::TriggerPort* trigger() { return trigger_ ? &*trigger_ : nullptr; }

  void note(CaptureEvent&& event) override;
  void collecting(std::uint32_t) override {}

  /// Takes the next event.
  std::optional<CaptureEvent> next() { return events_.pop(); }
  /// Events were discarded; those that next() returns came before.
  bool overrun() const { return overrun_.load(std::memory_order_acquire); }
  bool has_trigger() const { return trigger_.has_value(); }

  /// Ten heads at 29.97 Hz cause about 1000 events a second: the disk's stage may be busy for half a minute. 14 MB.
  static constexpr std::size_t kEvents = 32768;

 private:
  SpscRing<CaptureEvent> events_;
  std::atomic<bool> overrun_{false};
  LoggedHeads heads_;
  std::optional<LoggedTrigger> trigger_;
};

/// The records since nodald was started. A take gets all of them, because capture's state at a later moment cannot be
/// restored. When they exceed kMax, a take that is being recorded keeps its record, and later takes have none.
///
/// Threading: thread-bound to the disk's stage.
/// Ownership: the recorder outlives it.
/// Errors: none.
class FlightLog {
 public:
  /// `sets_held`: the most frame sets that readers hold at once.
  FlightLog(FlightRecorder& recorder, const std::string& software, std::size_t sets_held);

  /// Moves events to records; a record is closed when it is large or old.
  void collect(Instant now);
  /// Closes the open record.
  void close_record();

  /// A take begins: next() starts with the first record. False if the first records are gone.
  bool begin();
  /// The next record for the take; empty if there is none. Valid until the next call of a function.
  std::span<const std::uint8_t> next();
  /// The take has ended. Returns the last record for it; empty if it has no record.
  std::vector<std::uint8_t> end();
  /// Events were lost: there are no records after those that next() returns.
  bool overrun() const { return overrun_; }

  /// With ten heads at 29.97 Hz about an hour: firmware/flight/README.md.
  static constexpr std::size_t kMax = std::size_t{64} << 20;
  /// Size limit of a take's flight record, bytes. The record ends there.
  static constexpr std::uint64_t kMaxInTake = std::uint64_t{1} << 30;
  static constexpr Duration kRecordEvery = Duration::milliseconds(100);
  static constexpr std::size_t kRecordBytes = 16U << 10;

 private:
  FlightRecorder& recorder_;
  FlightEncoder encoder_;
  take::flight::Record open_;
  std::size_t open_bytes_ = 0;
  Instant opened_;
  std::deque<std::vector<std::uint8_t>> records_;
  std::size_t bytes_ = 0;      ///< bytes in records_
  std::uint32_t dropped_ = 0;  ///< number of records that were dropped from the front of records_
  std::uint32_t next_ = 0;     ///< number of the next record to give to the take, counted with the dropped ones
  std::uint64_t in_take_bytes_ = 0;
  bool in_take_ = false;
  bool overrun_ = false;
};

}  // namespace nodal::firmware
