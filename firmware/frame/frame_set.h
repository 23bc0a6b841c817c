// What travels the frame path: the frames of all heads that one trigger exposed, and why a frame is in no set.
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

/// Why a frame that was taken is in no set.
enum class LossReason : std::uint8_t {
  kLate,         ///< its set had gone
  kDuplicate,    ///< its set had one of this head
  kCorrupt,      ///< the port said so
  kTorn,         ///< the port said so
  kNoSignal,     ///< the port said so
  kWrongFormat,  ///< not the size or pixels the head promised
  kUnmatched,    ///< genlocked, and no trigger near its exposure
  kOverload,     ///< no room for another open set
  kFieldOrder,   ///< interlaced, and the field that should be second was exposed first
  kFieldParity,  ///< interlaced, and not both fields came; or not interlaced when it should be, or the other way round
  kBadTime,      ///< it says that it was exposed after it came, or long before
};
inline constexpr std::size_t kLossReasons = 11;
/// "late", "no-signal": as the wire and people have it.
std::string_view loss_reason_name(LossReason reason);

enum class GenlockState : std::uint8_t {
  kOff,        ///< heads run free; frames are grouped by their times alone
  kAcquiring,  ///< the trigger runs, or heads are being moved into step, and they have not been in step long enough
  kLocked,     ///< every frame began with its pulse, or without pulses with the others
  kHoldover,   ///< no pulses are seen, or a head cannot be moved, yet they are still as much in step as when it locked
  kLost,       ///< they are not
};
std::string_view genlock_state_name(GenlockState state);

using HeadMask = std::uint32_t;
inline constexpr HeadMask head_bit(std::size_t head) { return HeadMask{1} << head; }

/// How well a set's frames were exposed together, as far as the rig can know. It stays with the set, the raymap that is
/// made of it, and the take.
struct SyncEvidence {
  GenlockState state = GenlockState::kOff;  ///< when the set was closed
  std::optional<std::uint64_t> trigger;     ///< the pulse that exposed it, when there was one
  Duration spread;                          ///< latest minus earliest mid-exposure
  /// Latest minus earliest begin of an exposure, each counted from the pulse and the head's own delay: what the lock
  /// is judged by, since heads of different exposures cannot have both in common. Nothing: no pulse exposed it.
  std::optional<Duration> begin_spread;
  /// How much slower than nominal the exposures come, on the rig's clock, in 1/1000 ppm; nothing until it is known.
  std::optional<std::int32_t> drift_ppb;
  std::array<Duration, kMaxHeads> offset{};  ///< each frame's mid-exposure after the set's
};

/// What a head delivers, as far as is known: nothing while it was never open.
struct HeadShape {
  PixelFormat format = PixelFormat::kI420;
  int width = 0;
  int height = 0;
};
using HeadShapes = std::vector<std::optional<HeadShape>>;

/// The frames of one trigger. Heads whose bit is not in `mask` have no picture in it.
struct FrameSet {
  std::uint64_t number = 0;  ///< counts the rig's sets from 0, without gaps
  Instant mid_exposure;      ///< median over its frames; of interlaced ones, of their first fields
  Duration second_field;     ///< of interlaced frames: how much later their second fields were exposed
  HeadMask mask = 0;
  std::array<hal::FrameView, kMaxHeads> frames;
  SyncEvidence sync;

  bool has(std::size_t head) const { return (mask & head_bit(head)) != 0; }
};

/// A holder's share of a set. The heads get their buffers back when the last holder gives it up.
using SetLoan = Loan<FrameSet>;

}  // namespace nodal::firmware
