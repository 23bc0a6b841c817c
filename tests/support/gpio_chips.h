// GPIO chips for tests, in virtual time: they behave as the kernel's, until a test makes them fail, hang or lie.
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

/// Lines are written until the ports are gone, so a hook must not refer to variables of a test.
///
/// Threading: thread-safe, but that one thread alone calls pass() and suspend(). Unless `threads` is set, a runner's steps
/// are calls of the thread that passes time, rings or drives a line.
class GpioChips final : public hal::gpio::System {
 public:
  using LineName = hal::gpio::LineName;
  using LineEvent = hal::gpio::LineEvent;

  // What the machine is. Set before lines are claimed.
  void add(const std::string& chip, const std::string& label, std::uint32_t lines);
  /// An input that is wired to an output.
  void connect(const LineName& output, const LineName& input);
  bool threads = false;         ///< runners are threads, so that a line can hang
  bool refuse_threads = false;  ///< as a system does at its limit
  bool refuse_realtime = false;
  Duration write_time;                     ///< what a write takes
  std::function<Duration()> lateness;      ///< of a runner's wake-up at a time
  std::map<std::string, int> claim_error;  ///< by the line's text(): an errno

  // What a test does.
  std::function<int(const LineName&, bool high)> before_set;  ///< an errno makes the write fail
  std::function<int(const LineName&)> before_read;            ///< likewise reads of level and events
  std::function<Instant(Instant)> stamp;                      ///< changes the timestamp of an edge
  void hold(const LineName& line, const std::string& program);
  void drive(const LineName& line, bool high) { drive_burst(line, {high}); }
  /// Levels one after the other, before any thread of the port runs.
  void drive_burst(const LineName& line, const std::vector<bool>& levels);
  void unplug(const std::string& chip);
  void hang(const LineName& line);  ///< writes of this line do not return,
  void unhang();                    ///< until now
  void pass(Duration time);
  void suspend(Duration time);  ///< no thread runs, and no wake-up is made

  // What a test sees.
  bool wire(const LineName& line) const;
  std::vector<LineEvent> history(const LineName& line) const;  ///< changes of an output's level
  int claimed() const;
  std::uint64_t discarded_edges() const;  ///< the queue of 16 was full
  std::uint64_t steps() const;            ///< of all runners

  // What the port sees.
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
    std::vector<LineEvent> history;
  };
  using Key = std::pair<std::string, std::uint32_t>;
  Key key(const LineName& line) const;
  /// Null with an errno.
  std::pair<Wire*, int> claimable(const LineName& line);
  bool change(const Key& key, bool high);
  int set(const LineName& line, bool high);
  int get(const LineName& line);
  int read_events(const LineName& line, std::span<LineEvent> into);
  void release(const LineName& line);
  void wake(const LineName& line);

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, std::string> labels_;  ///< a chip's name by its label
  std::map<Key, Wire> wires_;
  std::map<Key, Key> connected_;
  std::set<std::string> unplugged_;
  std::set<Key> hung_;
  int hanging_ = 0;  ///< writes that hang now
  std::int64_t now_ns_ = 1'000'000'000;
  std::vector<StepRunner*> runners_;
  std::uint64_t discarded_ = 0;
  std::uint64_t steps_ = 0;
};

}  // namespace nodal::test
