// A simulated head: a lens model and a sensor on the rig's trigger line. It exists independently of being opened.
// SimRig::enumerator() opens it as a HeadPort; this class is the other half, for the test.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/sim/nudge.h"
#include "hal/sim/scene/jpeg_camera.h"
#include "hal/sim/scene/random.h"
#include "hal/sim/scene/scene.h"
#include "hal/sim/scene/sensor.h"
#include "hal/sim/trigger.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// How often each random fault occurs, in frames per million.
struct HeadFaults {
  std::uint32_t lose = 0, corrupt = 0, tear = 0, delay = 0, duplicate = 0;
  Duration longest_delay = Duration::milliseconds(20);
};

HeadLimits default_head_limits();

inline constexpr std::uint16_t kWhiteBalanceMin = 256;  ///< a sixteenth

struct HeadOptions {
  PixelFormat pixels = PixelFormat::kI420;  ///< YUV is full range BT.601, as in JPEG
  FrameRate rate;
  /// An interlaced head exposes two fields half a period apart; its height must be a multiple of four.
  Fields fields = Fields::kProgressive;
  HeadLimits limits = default_head_limits();
  HeadSettings settings;                                ///< at power-on
  Exposure reference = Exposure::microseconds(10'000);  ///< light 1 fills a pixel with this exposure and 0 dB
  int supersampling = 2;                                ///< n x n samples per pixel
  NoiseModel noise;
  int buffers = 4;
  Duration trigger_latency = Duration::microseconds(20);  ///< from a pulse to the start of the exposure
  Duration trigger_jitter = Duration::microseconds(2);    ///< per pulse, uniform in both directions
  Duration stamp_jitter;                          ///< error of the reported mid_exposure, uniform in both directions
  Duration readout = Duration::milliseconds(12);  ///< from the end of the exposure to the last byte
  std::int32_t free_run_drift_ppm = 0;            ///< positive is slow; at most 100 000 either way
  std::optional<Duration> free_run_phase;         ///< time from start() to the first exposure; random if not given
  HeadFaults faults;
};

/// The subset of the options that the sensor needs. The sensor of a head that delivers MJPEG delivers I420.
SensorOptions sensor_options(const HeadOptions& options);

/// The true data of one frame.
struct FrameTruth {
  std::uint32_t sequence = 0;
  std::optional<std::uint64_t> pulse;  ///< the pulse that started it
  Instant exposure_begin;
  Instant mid_exposure;
};

/// At any time: exposed + duplicated = taken + without_buffer + by_fault + discarded + waiting.
struct HeadCounts {
  std::uint64_t exposed = 0;
  std::uint64_t duplicated = 0;      ///< sent twice, by a fault
  std::uint64_t taken = 0;           ///< by take_frame()
  std::uint64_t without_buffer = 0;  ///< lost because the daemon held every buffer
  std::uint64_t by_fault = 0;        ///< lost by a test's order or by the fault rates
  std::uint64_t discarded = 0;       ///< exposed or in a buffer at stop() or unplug()
  std::uint64_t waiting = 0;         ///< exposed and not yet taken
  std::uint64_t pulses_ignored = 0;  ///< the head was still exposing when they came; not frames
};

/// Threading: thread-bound to capture.
/// Ownership: the clock, the trigger and the scene outlive it; it outlives its open port.
/// Errors: none of its own.
class SimHead final : public PulseSink {
 public:
  SimHead(ClockPort& clock, SimTrigger& trigger, ScenePtr scene, const HeadCalibration& truth,
          const HeadOptions& options, std::uint64_t seed);
  ~SimHead() override;

  // What the test uses.
  /// The next n exposed frames never arrive.
  void lose_frames(int n = 1) { lose_ += n; }
  void corrupt_next_frame() { corrupt_next_ = true; }
  /// The next frame's bytes are wrong, and its verdict does not say so.
  void spoil_next_frame() { spoil_next_ = true; }
  void tear_next_frame() { tear_next_ = true; }
  void duplicate_next_frame() { duplicate_next_ = true; }
  void delay_next_frame(Duration by) { delay_next_ = by; }
  /// The next frame's fields arrive in the other order, or without the second field.
  void swap_next_fields() { swap_fields_next_ = true; }
  void lose_next_field() { lose_field_next_ = true; }
  /// While stuck, the head accepts settings and nudges but does not apply them; frames report the real settings.
  void set_stuck(bool stuck) { stuck_ = stuck; }
  /// A factor on the light that the head sees: a cloud, a lamp.
  void set_light(double factor) { light_ = factor; }
  /// The device's own counter continues from `next`.
  void set_sequence(std::uint32_t next);
  /// A head in wired mode without its cable receives no pulse, so its own clock starts its exposures.
  void set_cable(bool connected) { cable_ = connected; }
  /// A head in wired mode exposes only on every n-th pulse.
  void set_pulses_an_exposure(int n) { pulses_an_exposure_ = n; }
  /// Without a signal, frames continue, grey, with kNoSignal.
  void set_signal(bool present) { signal_ = present; }
  void set_faults(const HeadFaults& faults) { options_.faults = faults; }
  /// Unplugs the head; its open port returns kDeviceGone permanently.
  void unplug();
  void replug();
  /// Renders the static scene now, which the first frame would otherwise do.
  void prepare();

  // What the test can query.
  const HeadIdentity& identity() const { return identity_; }
  const HeadCalibration& truth() const { return truth_; }
  const HeadOptions& options() const { return options_; }
  const HeadCounts& counts() const { return counts_; }
  bool present() const { return present_; }
  bool is_open() const { return port_ != nullptr; }
  bool streaming() const { return streaming_; }
  /// The truth of one of the newest 64 frames.
  std::optional<FrameTruth> truth_of(std::uint32_t sequence) const;

  // What the enumerator uses.
  Result<std::unique_ptr<HeadPort>> open();

  void on_pulse(std::uint64_t number, Instant at) override;
  void on_unseen(std::uint64_t pulses) override;

 private:
  class Port;
  struct Exposed {
    std::uint32_t sequence = 0;
    Instant begin, mid, received;
    Instant said_mid;
    Duration nudged;
    HeadSettings settings;
    FrameVerdict verdict = FrameVerdict::kGood;
    Fields fields = Fields::kProgressive;
    double light = 1;
    bool spoiled = false;
  };
  struct Pending {
    HeadSettings settings;
    int frames_left = 0;
  };

  Status start(TriggerMode mode);
  void stop();
  Status nudge(Duration by);
  void change(const HeadSettings& wanted);
  void step(Instant now);
  /// When the next frame can arrive at the earliest.
  std::optional<Instant> next_arrival() const;
  void run_free_until(Instant now);
  bool skip_to(Instant now);
  void lose_unseen(std::uint64_t frames);
  Instant free_run_begin() const;
  std::int64_t free_run_drift_ppb() const { return std::int64_t{options_.free_run_drift_ppm} * 1000; }
  Fields fields_that_come();
  void expose(Instant begin, std::optional<std::uint64_t> pulse);
  void deliver_until(Instant now);
  void fill(const Exposed& frame);
  void discard_waiting();
  /// A buffer's content.
  struct Rendering {
    std::vector<std::uint8_t> bytes;
    std::uint64_t holds = 0;         ///< what Sensor::render returned for `bytes`; 0: unknown
    std::vector<std::uint8_t> jpeg;  ///< the encoded picture of a head that delivers MJPEG
  };
  FrameView picture(const Exposed& frame, Rendering& rendering);

  ClockPort& clock_;
  SimTrigger& trigger_;
  ScenePtr scene_;
  const HeadCalibration truth_;
  HeadOptions options_;
  HeadIdentity identity_;
  HeadFormat format_;
  Random random_;
  std::uint64_t seed_;
  std::unique_ptr<Sensor> sensor_;
  std::unique_ptr<JpegCamera> jpeg_camera_;  ///< the encoder of a head that delivers MJPEG
  Port* port_ = nullptr;
  bool present_ = true;
  bool streaming_ = false;
  TriggerMode mode_ = TriggerMode::kFreeRun;
  HeadSettings settings_;   ///< as requested
  HeadSettings in_effect_;  ///< settings of the next exposure
  std::deque<Pending> changes_;
  Instant free_run_from_;
  std::uint64_t free_run_next_ = 0;
  Nudges nudges_;
  Instant busy_until_;
  Instant last_received_;
  std::uint32_t sequence_ = 0;
  bool keep_sequence_ = false;   ///< set by the test before a start
  std::deque<Exposed> exposed_;  ///< frames in the sensor or in transfer, sorted by arrival
  std::array<FrameTruth, 64> newest_{};
  HeadCounts counts_;
  int lose_ = 0;
  bool corrupt_next_ = false, spoil_next_ = false, tear_next_ = false, duplicate_next_ = false, signal_ = true;
  bool swap_fields_next_ = false, lose_field_next_ = false, stuck_ = false, cable_ = true;
  int pulses_an_exposure_ = 1;
  double light_ = 1;
  Duration delay_next_;
};

}  // namespace nodal::hal::sim
