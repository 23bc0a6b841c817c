// Fake GPIO chips in virtual time: they behave like the kernel's, until a test makes them fail, hang or report errors.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "hal/linux/gpio/system.h"

namespace nodal::test {

/// Lines are written until the ports are destroyed, so a hook must not refer to variables of a test.
///
/// Threading: thread-safe, but only one thread may call pass() and suspend(). Unless `threads` is set, a runner's steps
/// are calls on the thread that passes time, rings or drives a line.
class GpioChips final : public hal::gpio::System {
 public:
  using LineName = hal::gpio::LineName;
  using LineEvent = hal::gpio::LineEvent;

  // The machine's properties. Set them before lines are claimed.
  void add(const std::string& chip, const std::string& label, std::uint32_t lines);
  /// Wires an input to an output.
  void connect(const LineName& output, const LineName& input);
  bool threads = false;         ///< runners are threads, so that a line can hang
  bool refuse_threads = false;  ///< like a system at its limit
  bool refuse_realtime = false;
  bool discards_oldest = false;        ///< what a full queue discards: the oldest edges (libgpiod 2), or new ones (1.6)
  Duration write_time;                 ///< duration of a write
  std::function<Duration()> lateness;  ///< how late a runner wakes up at a given time
  std::map<std::string, int> claim_error;  ///< errno by the line's text()

  // What a test controls.
  std::function<int(const LineName&, bool high)> before_set;  ///< an errno makes the write fail
  std::function<int(const LineName&)> before_read;            ///< the same for reads of level and events
  std::function<Instant(Instant)> stamp;                      ///< changes the timestamp of an edge
  void hold(const LineName& line, const std::string& program);
  void drive(const LineName& line, bool high) { drive_burst(line, {high}); }
  /// Applies levels one after another, before any thread of the port runs.
  void drive_burst(const LineName& line, const std::vector<bool>& levels);
  void unplug(const std::string& chip);
  void hang(const LineName& line);  ///< writes of this line block
  void unhang();                    ///< ends hang()
  void pass(Duration time);
  void suspend(Duration time);  ///< no thread runs and no wake-up is due during this time

  // What a test can query.
  bool wire(const LineName& line) const;
  std::vector<LineEvent> history(const LineName& line) const;  ///< changes of an output's level
  int claimed() const;
  std::uint64_t discarded_edges() const;  ///< edges lost because the queue of 16 was full
  std::uint64_t steps() const;            ///< steps of all runners together

  // What the port uses.
  hal::gpio::Claim claim_output(const LineName& line, bool high) override;
  hal::gpio::Claim claim_input(const LineName& line, const hal::gpio::InputOptions& options) override;
  std::string holder(const LineName& line) override;
  std::vector<std::string> chips() override;
  Instant now() override;
  hal::gpio::Running run(const hal::gpio::RunOptions& options, hal::gpio::Step step) override;

 private:
  class ClaimedLine;
  class StepRunner;
  struct Wire {
    bool high = false;
    std::string holder;
    bool input = false;
    hal::gpio::InputOptions options;
    std::deque<LineEvent> events;
    bool was_full = false;  ///< at the last read
    std::vector<LineEvent> history;
  };
  using Key = std::pair<std::string, std::uint32_t>;
  Key key(const LineName& line) const;
  /// Null with an errno on failure.
  std::pair<Wire*, int> claimable(const LineName& line);
  bool change(const Key& key, bool high);
  int set(const LineName& line, bool high);
  int get(const LineName& line);
  int read_events(const LineName& line, std::span<LineEvent> into);
  void release(const LineName& line);
  void wake(const LineName& line);

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, std::string> labels_;  ///< chip names by label
  std::map<Key, Wire> wires_;
  std::map<Key, Key> connected_;
  std::set<std::string> unplugged_;
  std::set<Key> hung_;
  int hanging_ = 0;  ///< number of blocked writes
  std::int64_t now_ns_ = 1'000'000'000;
  std::vector<StepRunner*> runners_;
  std::uint64_t discarded_ = 0;
  std::uint64_t steps_ = 0;
};

}  // namespace nodal::test
