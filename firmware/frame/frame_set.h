// The data type of the frame path: the frames of all heads that one trigger exposed, and the reasons why a frame is
// lost.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "hal/head.h"
#include "protocol/base/loan.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Why a frame that was taken from a port is in no set.
enum class LossReason : std::uint8_t {
  kLate,         ///< its set was closed before it arrived
  kDuplicate,    ///< its set already has a frame of this head
  kCorrupt,      ///< the port's verdict
  kTorn,         ///< the port's verdict
  kNoSignal,     ///< the port's verdict
  kWrongFormat,  ///< its size or pixel format differs from the head's stated format
  kUnmatched,    ///< the genlock runs, and no trigger is near its exposure
  kOverload,     ///< the maximum number of sets is open already
  kFieldOrder,   ///< interlaced, and the field that should be second was exposed first
  kFieldParity,  ///< interlaced with one field only; or progressive where rig.toml says interlaced, or the reverse
  kBadTime,      ///< its timestamp is after its arrival, or too long before it
};
inline constexpr std::size_t kLossReasons = 11;
/// "late", "no-signal": the name in messages of the protocol and in reports.
std::string_view loss_reason_name(LossReason reason);

enum class GenlockState : std::uint8_t {
  kOff,        ///< heads run free; frames are grouped by their times alone
  kAcquiring,  ///< the trigger runs, or free-running heads are being aligned; not yet within the limit for long enough
  kLocked,     ///< every exposure begins with its pulse; without pulses, with those of the other heads
  kHoldover,   ///< no pulses are seen, or a head cannot be moved, but the heads are still within the limit
  kLost,       ///< the heads are no longer within the limit
};
std::string_view genlock_state_name(GenlockState state);

using HeadMask = std::uint32_t;
inline constexpr HeadMask head_bit(std::size_t head) { return HeadMask{1} << head; }

/// How well a set's frames were exposed together, as far as the rig can measure it. The set, the raymap that is made
/// from it, and the take all carry it.
struct SyncEvidence {
  GenlockState state = GenlockState::kOff;  ///< when the set was closed
  std::optional<std::uint64_t> trigger;     ///< number of the pulse that exposed it; empty without a pulse
  Duration spread;                          ///< latest minus earliest mid-exposure
  /// Latest minus earliest begin of exposure, each relative to the pulse plus the head's own delay. The lock is judged
  /// by this value, because heads with different exposure times cannot share begin and middle. Empty: no pulse exposed
  /// it.
  std::optional<Duration> begin_spread;
  /// How much slower than nominal the exposures repeat, on the rig's clock, in 1/1000 ppm; empty until it is measured.
  std::optional<std::int32_t> drift_ppb;
  std::array<Duration, kMaxHeads> offset{};  ///< each frame's mid-exposure after the set's
};

/// The format a head delivers. HeadShapes has an empty entry for a head that was never open.
struct HeadShape {
  PixelFormat format = PixelFormat::kI420;
  int width = 0;
  int height = 0;
};
using HeadShapes = std::vector<std::optional<HeadShape>>;

/// The frames of one trigger. A head whose bit is not set in `mask` has no picture in the set.
struct FrameSet {
  std::uint64_t number = 0;  ///< sets are numbered from 0 without gaps
  Instant mid_exposure;      ///< median over its frames; for interlaced frames, over their first fields
  FrameRate rate;            ///< at which sets come now
  Duration second_field;     ///< interlaced frames: exposure of the second field minus that of the first
  Duration period;           ///< from set to set, by the frame rate in force
  HeadMask mask = 0;
  std::array<hal::FrameView, kMaxHeads> frames;
  SyncEvidence sync;

  bool has(std::size_t head) const { return (mask & head_bit(head)) != 0; }
};

/// One holder's reference to a set. The heads get their buffers back when the last holder releases it.
using SetLoan = Loan<FrameSet>;

}  // namespace nodal::firmware
