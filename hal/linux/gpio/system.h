// The lines, the clock and the threads that the GPIO ports use, as an interface that tests replace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal::gpio {

/// A line of a chip: the chip's device name (gpiochip0) or its label (pinctrl-bcm2711), and the line's offset on it.
struct LineName {
  std::string chip;
  std::uint32_t offset = 0;
  /// "gpio:gpiochip0:17", as in rig.toml.
  std::string text() const;
  friend bool operator==(const LineName&, const LineName&) = default;
};

enum class Bias : std::uint8_t { kAsIs, kPullUp, kPullDown };
enum class EdgeKind : std::uint8_t { kRising, kFalling, kBoth };

struct InputOptions {
  bool active_low = false;  ///< level() and edges are inverted
  Bias bias = Bias::kAsIs;
  EdgeKind edges = EdgeKind::kBoth;  ///< after inversion
};

/// One edge, with the kernel's timestamp.
struct LineEvent {
  Instant at;
  bool high = false;       ///< the level after the edge, as far as the kernel knows
  bool after_gap = false;  ///< the kernel discarded edges before this one, or may have
};

/// Events that the kernel keeps for a line. While its queue is full it discards the new ones (libgpiod 1.6) or the
/// oldest ones (libgpiod 2).
inline constexpr std::size_t kKernelQueue = 16;

/// A claimed line; its destructor releases it, and the controller usually keeps the level.
///
/// Threading: set() from any thread; the others from one thread at a time.
/// Errors: errno values, never through errno.
class Line {
 public:
  virtual ~Line() = default;
  /// 0 or an errno. A chip behind a slow bus may take long.
  virtual int set(bool high) = 0;
  /// 0, 1 or a negative errno.
  virtual int get() = 0;
  /// The number of events written to `into`, oldest first, or a negative errno. Never waits.
  virtual int read_events(std::span<LineEvent> into) = 0;
  /// Becomes readable when there are events; -1: the line has none.
  virtual int descriptor() const { return -1; }
};

/// A claimed line, or the errno of the refusal.
struct Claim {
  std::unique_ptr<Line> line;
  int error = 0;
};

/// Calls a step function on a thread of its own: at the time that its last call returned, and after each ring().
///
/// Threading: ring() from any thread.
class Runner {
 public:
  virtual ~Runner() = default;  ///< joins the thread; waits for a step that is under way
  virtual void ring() = 0;
};
/// Gets the present time; returns the time of its next call, or kNever.
using Step = std::function<Instant(Instant now)>;
inline constexpr Instant kNever = Instant::from_ns(INT64_MAX);

struct RunOptions {
  const char* name = "";         ///< the thread's name, at most 15 characters
  bool realtime = false;         ///< SCHED_FIFO, where permitted
  std::vector<Line*> wake_on{};  ///< also called when one of these lines has events; not with realtime
};
struct Running {
  std::unique_ptr<Runner> runner;
  std::string notice;  ///< why the thread has no real-time priority; empty: it has, or was not asked to
};

/// Threading: thread-safe.
class System {
 public:
  virtual ~System() = default;
  virtual Claim claim_output(const LineName& line, bool high) = 0;
  virtual Claim claim_input(const LineName& line, const InputOptions& options) = 0;
  /// The name of the program that holds the line; empty when it is free or unknown.
  virtual std::string holder(const LineName& line) = 0;
  /// The machine's chips, such as "gpiochip0 (pinctrl-bcm2711, 58 lines)"; empty when there is none.
  virtual std::vector<std::string> chips() = 0;
  virtual Instant now() = 0;
  /// Throws std::system_error when the system refuses a thread.
  virtual Running run(const RunOptions& options, Step step) = 0;
};

/// This machine's kernel, through libgpiod.
System& kernel();

/// What a refused claim means and what to do about it, in one sentence that names the line.
Error explain_claim(System& system, const LineName& line, int error);
/// What a failed read or write of a claimed line means and what to do about it; `doing` says what was tried, such as
/// "writing".
Error explain_use(const LineName& line, const std::string& doing, int error);

}  // namespace nodal::hal::gpio
