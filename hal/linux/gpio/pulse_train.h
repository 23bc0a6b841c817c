// When each line rises and falls, and what happens when the thread wakes late.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "hal/linux/gpio/edge_log.h"
#include "hal/linux/gpio/output_line.h"
#include "hal/linux/gpio/system.h"

namespace nodal::hal::gpio {

/// One start() of the trigger.
struct Train {
  std::uint32_t id = 0;  ///< 0: no pulses
  FrameRate rate;
  Duration width;
  bool active_high = true;
  Instant started;              ///< moment of pulse 0
  std::vector<Duration> delay;  ///< delay of each line's pulse relative to the trigger
  std::size_t reference = 0;    ///< the line whose pulses are reported: one with the shortest delay
};

/// What the pulse thread counts; read by any thread.
struct PulseCounts {
  std::atomic<std::uint64_t> late{0};         ///< pulses not sent, because the thread woke too late
  std::atomic<std::uint64_t> refused{0};      ///< writes that the driver refused
  std::atomic<std::int64_t> latest_ns{0};     ///< the longest delay of a pulse that was sent
  std::atomic<int> error{0};                  ///< errno that ended the train; 0: none
  std::atomic<std::uint32_t> error_line{0};   ///< its line,
  std::atomic<std::uint32_t> error_train{0};  ///< and the train
};

/// Threading: thread-bound to the pulse thread; counts() from any thread.
/// Ownership: lines, log and system outlive it.
class PulseTrain {
 public:
  /// The time that a line must be inactive between two pulses.
  static constexpr Duration kGap = Duration::microseconds(100);
  /// A pulse that would be later than a quarter of a period, or than this, is not sent.
  static constexpr Duration kTooLate = Duration::milliseconds(100);
  /// Refused writes in a row that end the train; one alone costs a pulse.
  static constexpr int kRefusedInRow = 5;

  PulseTrain(System& system, const std::vector<std::unique_ptr<OutputLine>>& lines, EdgeLog& log)
      : system_(system), lines_(lines), log_(log) {}

  /// Ends the train before, leaves the lines inactive and begins this one.
  void begin(const Train& train);
  /// Writes what is due; returns the time of the next write, or kNever.
  Instant step(Instant now);
  const PulseCounts& counts() const { return counts_; }

 private:
  struct State {
    std::uint64_t next = 0;  ///< number of the pulse that is sent next
    bool active = false;
    Instant fall_at;
    int refused = 0;  ///< refused writes in a row
  };
  Instant rise_of(std::size_t line, std::uint64_t number) const;
  void step_line(std::size_t line, Instant now);
  void rise(std::size_t line);
  bool write(std::size_t line, bool active);
  void end(int error, std::size_t line);

  System& system_;
  const std::vector<std::unique_ptr<OutputLine>>& lines_;
  EdgeLog& log_;
  Train train_;
  std::vector<State> states_;
  PulseCounts counts_;
};

}  // namespace nodal::hal::gpio
