// Everything that determines what capture does, and what it did, in order. A flight record stores it, and a player
// steps capture through it again.
#pragma once

#include <cstdint>
#include <string_view>
#include <variant>

#include "firmware/capture/capture.h"
#include "firmware/frame/frame_set.h"
#include "hal/head.h"
#include "hal/trigger.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "stitch/blend/meter.h"

namespace nodal::firmware {

// Answers of ports. The ports that capture calls note them (firmware/flight/logged_ports.h). A take_frame() or
// take_edge() that returned nothing is not noted: its place is known, because two such calls of one port are never next
// to each other without an event between them.

/// HeadEnumerator::open(). With an error, only `status` counts.
struct HeadOpened {
  HeadIndex head = 0;
  Status status;
  hal::HeadIdentity identity;
  hal::HeadFormat format;
  hal::HeadLimits limits;
};
struct HeadCalled {
  enum class Call : std::uint8_t { kStart, kStop, kExposure, kGain, kWhiteBalance, kGamma, kNudge };
  static constexpr int kCalls = 7;
  HeadIndex head = 0;
  Call call = Call::kStop;
  std::int64_t value = 0;  ///< the argument: mode, ns, mdB, red << 16 | blue, thousandths, ns
  Status status;
};
struct HeadDelivered {
  HeadIndex head = 0;
  hal::FrameView frame;  ///< the picture is not stored: planes[0].data only says whether there is one
};
struct HeadFailed {
  HeadIndex head = 0;
  Error error;
};
struct TriggerStarted {
  hal::TriggerSettings settings;
  Status status;
};
struct TriggerStopped {};
struct PulseSeen {
  hal::TriggerEdge edge;
};
struct TriggerFailed {
  Error error;
};

// What capture received from other stages, and what it did. Capture notes these.

struct StepBegun {
  Instant now;
};
struct LightTaken {
  blend::SphereLight light;
};
struct CommandTaken {
  CaptureRequest command;
};
struct CommandAnswered {
  std::uint64_t ticket = 0;
  Status status;
};
struct SetClosed {
  std::uint64_t number = 0;
  Instant mid_exposure;
  HeadMask mask = 0;
  SyncEvidence sync;
};
/// The last reader released a set, and its frames went back to the heads.
struct SetReturned {
  std::uint64_t number = 0;
  std::uint32_t collection = 0;  ///< which of the step's calls of CaptureLog::collecting() it follows, from 1
};
struct FramesLost {
  HeadIndex head = 0;
  LossReason reason{};
  std::uint64_t count = 0;  ///< frames lost so far, in total
};
struct GenlockChanged {
  GenlockState state{};
};

using CaptureEvent = std::variant<StepBegun, HeadOpened, HeadCalled, HeadDelivered, HeadFailed, TriggerStarted,
                                  TriggerStopped, PulseSeen, TriggerFailed, LightTaken, CommandTaken, CommandAnswered,
                                  SetClosed, SetReturned, FramesLost, GenlockChanged>;

/// Threading: thread-bound to capture.
/// Ownership: outlives capture.
/// Errors: none.
class CaptureLog {
 public:
  virtual ~CaptureLog() = default;
  virtual void note(CaptureEvent&& event) = 0;
  /// Capture is about to take back the sets that no reader holds. Other threads decide which these are; a player
  /// releases those of the record here. `collection` counts the calls of a step from 1.
  virtual void collecting(std::uint32_t collection) = 0;
};

}  // namespace nodal::firmware
