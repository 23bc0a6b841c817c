// Where one frame set's pictures are copied on their way to the blend, for a host that asks for them.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "firmware/frame_set.h"
#include "firmware/raymap.h"
#include "protocol/base/image.h"

namespace nodal::firmware {

/// A copy of a frame set, and the memory it goes to.
struct TappedSet {
  /// Where a head's picture goes, packed; what a head delivers otherwise is left out.
  struct Place {
    PixelFormat format = PixelFormat::kI420;
    int width = 0;
    int height = 0;
    std::size_t offset = 0;
    hal::HeadSettings in_effect;
  };
  std::array<Place, kMaxHeads> places;
  HeadMask wanted = 0;  ///< heads that have a place
  Buffer bytes;

  // Filled in with the pictures.
  std::uint64_t set = 0;
  Instant mid_exposure;
  SyncEvidence sync;
  HeadMask heads = 0;     ///< whose pictures are there
  Sha256 calibration{};   ///< that the set is blended with
  bool blended = false;   ///< there was one
};

/// Costs the frame path one atomic load a set until somebody wants one; then a copy, by one of the blend's threads and
/// into memory that control took. The blend leaves it alone while it is behind.
///
/// Threading: wanted() and fill() by one thread of the blend at a time, the rest by control; neither ever waits.
/// Ownership: owns the copy between want() and take().
/// Errors: none.
class FrameTap {
 public:
  /// Asks for the next set. False, and nothing done, while another is under way.
  bool want(TappedSet places);
  /// Takes the wish back. False when it is being filled, or full: take() will have it.
  bool withdraw();
  /// What was wanted, once it is there.
  std::optional<TappedSet> take();

  bool wanted() const { return state_.load(std::memory_order_acquire) == State::kWanted; }
  /// Copies the set's pictures if they are still wanted. `calibration`: null for none.
  void fill(const FrameSet& set, const Sha256* calibration);

 private:
  enum class State : std::uint8_t { kIdle, kWanted, kFilling, kFull };
  std::atomic<State> state_{State::kIdle};
  TappedSet copy_;
};

}  // namespace nodal::firmware
