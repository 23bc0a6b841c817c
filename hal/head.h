#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal {

/// Who a head is, whatever number the system gave it today.
struct HeadIdentity {
  std::string path;    ///< where it is plugged in, such as "usb-0000:00:14.0-2.1" or "sim:cam3"
  std::string serial;  ///< of the device, empty when it has none
  std::string model;
};

/// A head's curve between light and numbers, encoded = light^(1/gamma), gamma in thousandths; 0 is the curve the head
/// comes with, which its calibration describes.
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

/// How far a head in free run can be moved in time: a period is made longer or shorter now and then.
struct NudgeLimits {
  Duration step;      ///< moves and limits are multiples of it, a line's time or a packet's; 0: it cannot be moved
  Duration shortest;  ///< what one period can be shorter by, as a negative; 0: it can only wait
  Duration longest;   ///< what one period can be longer by
  /// Frames between nudge() and the first frame that comes later or earlier for it; at least 1.
  int latency_frames = 1;

  bool possible() const { return step > Duration(); }
  friend bool operator==(const NudgeLimits&, const NudgeLimits&) = default;
};

/// What a head can be asked to do. A range of one value says that it is fixed.
struct HeadLimits {
  Exposure exposure_min, exposure_max;
  Gain gain_min, gain_max;
  Gamma gamma_min, gamma_max;  ///< both 0: it has none to set; else 0 is allowed beside the range
  bool has_white_balance = false;
  bool has_trigger_input = false;
  /// Frames between a setting's call and the first frame that carries it.
  int control_latency_frames = 0;
  NudgeLimits nudge;
};

/// What the head sends: fixed from start() to stop().
struct HeadFormat {
  PixelFormat pixels = PixelFormat::kI420;
  int width = 0;
  int height = 0;
  Fields fields = Fields::kProgressive;  ///< not kTopOnly, kBottomOnly
  FrameRate rate;
};

enum class TriggerMode : std::uint8_t {
  kFreeRun,   ///< the head's own clock starts exposures
  kExternal,  ///< a pulse on its trigger input does
};

/// Why a frame is what it is. Every buffer says so; nothing is dropped silently below this port.
enum class FrameVerdict : std::uint8_t {
  kGood = 0,
  kCorrupt = 1,   ///< the driver or the decoder says the bytes are wrong
  kTorn = 2,      ///< shorter than a frame
  kNoSignal = 3,  ///< bytes came, the input has no picture
};

using BufferSlot = std::uint16_t;

/// The settings a frame was taken with, as far as the head can tell.
struct HeadSettings {
  Exposure exposure;  ///< of an interlaced frame: of each field
  Gain gain;
  WhiteBalance white_balance;
  Gamma gamma;
  friend bool operator==(const HeadSettings&, const HeadSettings&) = default;
};

/// One frame in a buffer of the head's.
struct FrameView {
  BufferSlot slot = 0;
  std::uint32_t sequence = 0;  ///< the device's own count; restarts and wraps as it pleases
  /// Middle of the exposure on the rig's clock, by the port's best knowledge; of an interlaced frame its first field's,
  /// and the second's is half a period later.
  Instant mid_exposure;
  Instant received;  ///< when the last byte was in memory
  HeadSettings in_effect;
  Duration nudged;  ///< what nudge() moved this exposure by, since start(), as far as it has been done
  FrameVerdict verdict = FrameVerdict::kGood;
  Fields fields = Fields::kProgressive;  ///< what came; a frame that is not what the format says is still a frame
  ImageView image;
};

/// What a port mended by itself, since it was opened.
struct HeadRecoveries {
  std::uint64_t restarts = 0;         ///< times its stream broke and was started again
  std::uint64_t refused_buffers = 0;  ///< buffers that the driver did not take back at once
  friend bool operator==(const HeadRecoveries&, const HeadRecoveries&) = default;
};

/// A head as the rig sees it: settings go in, frames come out, and it may vanish at any call.
/// Every call returns at once and never waits. A port whose device has slow calls leaves them to a thread of its
/// enumerator's: start() and set_…() then only request, and what came of it is seen by take_frame() and its frames.
///
/// Threading: thread-bound to capture.
/// Ownership: the port owns its buffers; a FrameView is valid until release() or stop().
/// Errors: kDeviceGone is final for this object; drop it and wait for the enumerator.
class HeadPort {
 public:
  virtual ~HeadPort() = default;
  virtual const HeadIdentity& identity() const = 0;
  virtual const HeadFormat& format() const = 0;
  virtual const HeadLimits& limits() const = 0;

  /// kWrongState when started already, kUnsupported for a trigger it has no input for; both change nothing.
  virtual Status start(TriggerMode trigger) = 0;
  /// Takes back every lent buffer. Safe in any state, any number of times.
  virtual void stop() = 0;

  /// Each takes effect limits().control_latency_frames later; the frame that carries it says so in
  /// FrameView::in_effect, which is what the head did and never what it was last asked.
  /// A value outside the limits is kBadValue, a setting that the head does not have kUnsupported; both change nothing.
  /// What is set while stopped is carried by the first frame.
  virtual Status set_exposure(Exposure exposure) = 0;
  virtual Status set_gain(Gain gain) = 0;
  virtual Status set_white_balance(WhiteBalance balance) = 0;
  virtual Status set_gamma(Gamma gamma) = 0;

  /// In free run: every exposure from the latency on comes later by `by`, or earlier when it is negative, against what
  /// the head's clock would have it. What is beyond one period's limits, or was asked before and is not done yet, takes
  /// more periods. Rounded to a step; FrameView::nudged says what was done.
  /// kUnsupported when it cannot, or not that way; kWrongState when it is not in free run.
  virtual Status nudge(Duration by) = 0;

  /// The next frame, nothing when none is due, or an error: kWrongState when not started.
  virtual Result<std::optional<FrameView>> take_frame() = 0;
  /// A slot that is not lent is ignored.
  virtual void release(BufferSlot slot) = 0;
  virtual HeadRecoveries recoveries() const { return {}; }
};

/// Finds heads by where they are plugged in and opens them, again after they vanished.
///
/// Threading: thread-bound to capture.
/// Ownership: hands out heads; they may outlive neither the enumerator nor its world.
/// Errors: kNoSuchDevice when nothing answers at `path` now, kBusy when it is open already, kNotReady while it is being
///   opened, which takes some devices seconds; ask again later.
class HeadEnumerator {
 public:
  virtual ~HeadEnumerator() = default;
  virtual Result<std::unique_ptr<HeadPort>> open(const std::string& path) = 0;
  /// Identities of everything that could be opened now.
  virtual std::vector<HeadIdentity> list() = 0;
};

}  // namespace nodal::hal
