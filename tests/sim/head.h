// The swarm's head: minimal frames, each stamped with the true data, and every possible fault of a head.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/head.h"
#include "hal/sim/clock.h"
#include "hal/sim/nudge.h"
#include "hal/sim/scene/random.h"
#include "tests/sim/events.h"
#include "tests/sim/picture.h"
#include "tests/sim/stamp.h"

namespace nodal::swarm {

/// The parameters of a head, constant for a run.
struct HeadNature {
  FrameRate rate;
  Fields fields = Fields::kProgressive;
  PixelFormat pixels = PixelFormat::kGrey8;
  ColourCoding coding;
  int buffers = 6;
  Duration latency = Duration::microseconds(20);  ///< from a pulse to the start of the exposure
  Duration latency_jitter;                        ///< jitter of each exposure, also in free run
  Duration readout = Duration::milliseconds(8);
  std::int32_t drift_ppm = 0;  ///< drift in free run; positive is slow
  Duration clock_jitter;       ///< error of the port's mid_exposure
  int control_latency = 2;
  Duration delay;      ///< additional latency in wired mode, which rig.toml knows
  bool wired = false;  ///< it follows the pulses without its driver's knowledge; its own clock replaces missing ones
  hal::NudgeLimits nudge;  ///< its nudge limits in free run; by default it cannot be nudged
};

/// Probabilities per frame, in a million, during a storm of faults.
struct FrameFaults {
  std::uint32_t lose = 0, corrupt = 0, tear = 0, duplicate = 0, late = 0, wrong_size = 0, miss_pulse = 0;
  Duration longest_late = Duration::milliseconds(20);
};

/// At any time: exposed + duplicated = taken + lost + discarded + waiting.
struct HeadCounts {
  std::uint64_t exposed = 0, duplicated = 0, taken = 0, lost = 0, discarded = 0;
};

/// Threading: thread-bound.
/// Ownership: refers to the clock and the queue; must outlive its open port.
/// Errors: none of its own.
class Head {
 public:
  Head(std::uint8_t index, hal::sim::SimClock& clock, EventQueue& queue, const HeadNature& nature, std::uint64_t seed);
  ~Head();

  // What the swarm controls.
  void lose(int frames) { lose_ += frames; }
  void corrupt(int frames) { corrupt_ += frames; }
  void tear(int frames) { tear_ += frames; }
  void duplicate(int frames) { duplicate_ += frames; }
  void resize(int frames) { resize_ += frames; }
  void delay(int frames, Duration by);
  void miss_pulses(int pulses) { miss_ += pulses; }
  void set_signal(bool present) { signal_ = present; }
  void set_stuck(bool stuck) { stuck_ = stuck; }  ///< accepts settings but does not apply them
  void set_deaf(bool deaf);                       ///< ignores pulses: it continues on its own clock, and drifts slowly
  void set_half_rate(bool half) { half_rate_ = half; }  ///< exposes only on every second pulse in wired mode
  void stall(Duration how_long);                        ///< delivers nothing until then, then everything
  void set_sequence(std::uint32_t next) { sequence_ = next; }
  void set_clock_error(Duration off) { clock_error_ = off; }  ///< error of the port's timestamps: a wrap, a clock step
  void shift(Duration by);                                    ///< the rig's clock jumped by that much
  void set_storm(const FrameFaults& storm) { storm_ = storm; }
  void unplug();
  void replug() { present_ = true; }
  /// Ends all faults except its constant parameters; an unplugged head returns.
  void forget_faults();

  // What the swarm can query.
  const HeadCounts& counts() const { return counts_; }
  bool present() const { return present_; }
  bool streaming() const { return streaming_; }
  /// Pulses start its exposures, in wired mode: started the newest one.
  bool triggered() const {
    return streaming_ && (mode_ == hal::TriggerMode::kExternal || (mode_ == hal::TriggerMode::kWired && by_pulse_));
  }
  bool wired() const { return nature_.wired; }
  bool is_open() const { return port_ != nullptr; }
  Instant started() const { return started_; }
  std::size_t waiting() const { return exposed_.size() + filled_.size(); }
  const std::string& path() const { return identity_.path; }
  const hal::HeadSettings& asked() const { return asked_; }

  // What the world and the enumerator call.
  Result<std::unique_ptr<hal::HeadPort>> open();
  void on_pulse(PulseId pulse, Instant at);
  void on_expose(const Event& event);
  /// Returns true if a frame can be taken.
  bool on_arrive(const Event& event);

 private:
  class Port;
  struct Frame {
    Stamp stamp;
    std::uint32_t sequence = 0;
    Instant mid;  ///< as reported by the port
    Instant received;
    Duration nudged;
    hal::HeadSettings settings;
    hal::FrameVerdict verdict = hal::FrameVerdict::kGood;
    bool resized = false;  ///< wrong size, or, if interlaced, wrong fields
    bool cut = false;      ///< a JPEG without its end, of which its verdict does not tell
  };
  struct Pending {
    hal::HeadSettings settings;
    int frames_left = 0;
  };
  struct Buffer {
    enum class State : std::uint8_t { kFree, kFilled, kLent } state = State::kFree;
    std::vector<std::uint8_t> picture;
    Frame frame;
  };

  Status start(hal::TriggerMode mode);
  Status nudge(Duration by);
  void stop();
  void change(const hal::HeadSettings& wanted);
  void run_free(Instant from);
  void expose(Instant begin, PulseId pulse);
  void deliver(Frame frame);
  void discard();
  hal::FrameView view(std::size_t slot) const;
  bool interlaced() const { return nature_.fields != Fields::kProgressive; }
  static bool take_one(int& count);

  hal::sim::SimClock& clock_;
  EventQueue& queue_;
  const HeadNature nature_;
  hal::HeadIdentity identity_;
  hal::HeadFormat format_;
  hal::HeadLimits limits_;
  hal::sim::Random random_;
  const std::uint8_t index_;

  Port* port_ = nullptr;
  bool present_ = true, streaming_ = false, deaf_ = false, half_rate_ = false, by_pulse_ = false;
  hal::TriggerMode mode_ = hal::TriggerMode::kFreeRun;
  std::uint32_t epoch_ = 0;
  Instant started_;
  Instant free_run_from_;
  std::uint64_t free_run_next_ = 0;
  hal::sim::Nudges nudges_;
  Instant last_begin_, busy_until_, last_received_, stalled_until_;
  hal::HeadSettings asked_, in_effect_;
  std::deque<Pending> changes_;
  std::uint32_t sequence_ = 0;
  std::uint64_t serial_ = 0;
  std::deque<Frame> exposed_;
  std::vector<Buffer> buffers_;
  std::deque<hal::BufferSlot> filled_;
  HeadCounts counts_;

  int lose_ = 0, corrupt_ = 0, tear_ = 0, duplicate_ = 0, resize_ = 0, late_ = 0, miss_ = 0;
  bool signal_ = true, stuck_ = false;
  Duration late_by_, clock_error_;
  FrameFaults storm_;
};

}  // namespace nodal::swarm
