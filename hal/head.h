#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/wake_ups.h"
#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal {

/// Identifies a head independently of the number that the system gave it.
struct HeadIdentity {
  std::string path;    ///< where it is connected, such as "usb-0000:00:14.0-2.1" or "sim:cam3"
  std::string serial;  ///< the device's serial number; empty if it has none
  std::string model;
};

/// A head's curve between light and encoded values, encoded = light^(1/gamma), gamma in thousandths. 0 is the head's
/// default curve, which its calibration describes.
class Gamma {
 public:
  constexpr Gamma() = default;
  static constexpr Gamma thousandths(std::int32_t n) { return Gamma(n); }
  constexpr std::int32_t thousandths() const { return thousandths_; }
  friend constexpr auto operator<=>(Gamma, Gamma) = default;

 private:
  explicit constexpr Gamma(std::int32_t n) : thousandths_(n) {}
  std::int32_t thousandths_ = 0;
};

/// How far a head in free run can be shifted in time, by making some frame periods longer or shorter.
struct NudgeLimits {
  Duration step;      ///< shifts and limits are multiples of it, such as a line's time; 0: it cannot be shifted
  Duration shortest;  ///< the most by which one period can be shortened, as a negative; 0: it can only be delayed
  Duration longest;   ///< the most by which one period can be lengthened
  /// Frames between nudge() and the first frame that it shifts; at least 1.
  int latency_frames = 1;

  bool possible() const { return step > Duration(); }
  friend bool operator==(const NudgeLimits&, const NudgeLimits&) = default;
};

/// The ranges of a head's settings. A range of one value means that the setting is fixed.
struct HeadLimits {
  Exposure exposure_min, exposure_max;
  Gain gain_min, gain_max;
  Gamma gamma_min, gamma_max;  ///< both 0: it cannot be set; else 0 is allowed in addition to the range
  bool has_white_balance = false;
  bool has_trigger_input = false;
  /// Frames between a set_…() call and the first frame with the new setting.
  int control_latency_frames = 0;
  NudgeLimits nudge;
};

/// The format of the frames; fixed from start() to stop().
struct HeadFormat {
  PixelFormat pixels = PixelFormat::kI420;
  int width = 0;
  int height = 0;
  Fields fields = Fields::kProgressive;  ///< not kTopOnly, kBottomOnly
  FrameRate rate;
};

enum class TriggerMode : std::uint8_t {
  kFreeRun,   ///< the head's own clock starts exposures
  kExternal,  ///< a pulse on its trigger input starts them
  /// A pulse on a line that its driver does not know starts them, such as the genlock of an NTSC camera. Without pulses
  /// the head's own clock starts them. The port does the same as in free run.
  kWired,
};

/// Whether a frame is good, and if not, why. Every buffer has a verdict; nothing is dropped silently.
enum class FrameVerdict : std::uint8_t {
  kGood = 0,
  kCorrupt = 1,   ///< the driver or the decoder reports wrong bytes
  kTorn = 2,      ///< shorter than a frame
  kNoSignal = 3,  ///< there are bytes, but the input has no picture
};

using BufferSlot = std::uint16_t;

/// The settings with which a frame was taken, as far as the head reports them.
struct HeadSettings {
  Exposure exposure;  ///< exposure of the frame; if it is interlaced, of each field
  Gain gain;
  WhiteBalance white_balance;
  Gamma gamma;
  friend bool operator==(const HeadSettings&, const HeadSettings&) = default;
};

/// One frame in one of the head's buffers.
struct FrameView {
  BufferSlot slot = 0;
  std::uint32_t sequence = 0;  ///< the device's own counter; may restart and wrap at any time
  /// The port's best estimate of the middle of the exposure on the rig's clock. For an interlaced frame it is that of
  /// the first field; the second field is half a period later.
  Instant mid_exposure;
  Instant received;  ///< when the last byte was in memory
  HeadSettings in_effect;
  Duration nudged;  ///< the part of all nudges since start() that shifted this exposure
  FrameVerdict verdict = FrameVerdict::kGood;
  Fields fields = Fields::kProgressive;  ///< as received; may differ from the format
  ImageView image;
};

/// Counts of problems that a port has corrected by itself since it was opened.
struct HeadRecoveries {
  std::uint64_t restarts = 0;         ///< how often its stream failed and was started again
  std::uint64_t refused_buffers = 0;  ///< buffers that the driver did not accept at once
  friend bool operator==(const HeadRecoveries&, const HeadRecoveries&) = default;
};

/// A head as the rig sees it: settings go in, frames come out; it can disappear at any call. Every call returns at once
/// and never waits. If a device's calls are slow, the port runs them on its enumerator's thread: start() and set_…()
/// then only request, and take_frame() and its frames report the result.
///
/// Threading: thread-bound to capture.
/// Ownership: the port owns its buffers; a FrameView is valid until release() or stop().
/// Errors: kDeviceGone is final for this object; drop it and open the head again with the enumerator.
class HeadPort {
 public:
  virtual ~HeadPort() = default;
  virtual const HeadIdentity& identity() const = 0;
  virtual const HeadFormat& format() const = 0;
  virtual const HeadLimits& limits() const = 0;

  /// kWrongState if started already, kUnsupported for kExternal without a trigger input; both change nothing.
  virtual Status start(TriggerMode trigger) = 0;
  /// Takes back every lent buffer. Safe in any state, any number of times.
  virtual void stop() = 0;

  /// A setting takes effect limits().control_latency_frames later; FrameView::in_effect of a frame holds the settings
  /// that the head really used, never just the requested ones. A value outside the limits is kBadValue, a setting that
  /// the head does not have kUnsupported; both change nothing. Settings made while stopped apply from the first frame
  /// on.
  virtual Status set_exposure(Exposure exposure) = 0;
  virtual Status set_gain(Gain gain) = 0;
  virtual Status set_white_balance(WhiteBalance balance) = 0;
  virtual Status set_gamma(Gamma gamma) = 0;

  /// Only in free run: shifts every exposure from the latency on by `by` (negative: earlier) relative to the head's own
  /// clock. A shift beyond one period's limits, and the rest of earlier shifts, are spread over more periods. Rounded
  /// to a step; FrameView::nudged reports the executed shift. kUnsupported if the head cannot shift, or not in that
  /// direction; kWrongState if it is not in free run.
  virtual Status nudge(Duration by) = 0;

  /// The next frame, nothing if none is due, or an error: kWrongState if not started.
  virtual Result<std::optional<FrameView>> take_frame() = 0;
  /// Adds what wakes a thread for the next frame, after take_frame() found none. May end the sleep early, never late.
  virtual void add_wake_ups(WakeUps& to) const = 0;
  /// Ignores a slot that is not lent.
  virtual void release(BufferSlot slot) = 0;
  virtual HeadRecoveries recoveries() const { return {}; }
};

/// Finds heads by where they are connected and opens them, also again after they disappeared.
///
/// Threading: thread-bound to capture.
/// Ownership: hands out heads; destroy them before the enumerator and the objects that it uses.
/// Errors: kNoSuchDevice if nothing answers at `path` now, kBusy if it is open already, kNotReady while it is being
///   opened, which takes seconds for some devices; call again later.
class HeadEnumerator {
 public:
  virtual ~HeadEnumerator() = default;
  virtual Result<std::unique_ptr<HeadPort>> open(const std::string& path) = 0;
  /// The identities of all heads that could be opened now.
  virtual std::vector<HeadIdentity> list() = 0;
};

}  // namespace nodal::hal
