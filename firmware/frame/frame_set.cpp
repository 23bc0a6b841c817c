#include "firmware/frame/frame_set.h"

namespace nodal::firmware {

std::string_view loss_reason_name(LossReason reason) {
  switch (reason) {
    case LossReason::kLate: return "late";
    case LossReason::kDuplicate: return "duplicate";
    case LossReason::kCorrupt: return "corrupt";
    case LossReason::kTorn: return "torn";
    case LossReason::kNoSignal: return "no-signal";
    case LossReason::kWrongFormat: return "wrong-format";
    case LossReason::kUnmatched: return "unmatched";
    case LossReason::kOverload: return "overload";
    case LossReason::kFieldOrder: return "field-order";
    case LossReason::kFieldParity: return "field-parity";
    case LossReason::kBadTime: return "bad-time";
  }
  return "unknown";
}

std::string_view genlock_state_name(GenlockState state) {
  switch (state) {
    case GenlockState::kOff: return "off";
    case GenlockState::kAcquiring: return "acquiring";
    case GenlockState::kLocked: return "locked";
    case GenlockState::kHoldover: return "holdover";
    case GenlockState::kLost: return "lost";
  }
  return "unknown";
}

}  // namespace nodal::firmware
