// What each head delivers, how the take stores it, and copies of its pictures.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/record/head_coder.h"
#include "firmware/record/picture_ring.h"
#include "firmware/record/take_row.h"
#include "hal/head.h"
#include "protocol/base/units.h"
#include "protocol/take/stream.h"

namespace nodal::firmware {

/// A head's stream in the take is that of its first picture. A picture of another format is replaced by a placeholder
/// until kFormatStays after that; then it changes the stream, which starts a segment.
///
/// Threading: thread-bound to the recorder.
/// Ownership: owns the coders.
/// Errors: none; a picture that is not stored says why in RecordedFrame::placeholder.
class HeadStreams {
 public:
  using InTake = std::array<std::optional<take::Stream>, kMaxHeads>;

  explicit HeadStreams(const RigConfig& config);

  /// A take begins.
  void begin() { in_take_ = {}; }
  /// The streams in the take; empty for a head without a picture so far.
  const InTake& in_take() const { return in_take_; }
  /// Notes the formats of heads that are new, or have changed for long enough. True if a stream changed.
  bool follow(const FrameSet& set);
  /// The most that the stored picture has.
  std::size_t most_bytes(const hal::FrameView& frame, std::size_t head);
  /// Stores a picture if its format is that of the take. `quality`: of a JPEG that is encoded for it. False if the ring
  /// has no room.
  bool store(const hal::FrameView& frame, std::size_t head, int quality, PictureRing& ring, RecordedFrame& to);

  static constexpr Duration kFormatStays = Duration::seconds(1);

 private:
  /// What a head's newest picture is, and how it is stored.
  struct Format {
    take::Stream delivered;
    take::Stream stored;
    std::optional<HeadCoder> coder;  ///< used for stored pictures that differ; made when the first is stored
  };
  Format& format_of(const hal::FrameView& frame, std::size_t head);

  std::array<TakeMode, kMaxHeads> modes_{};
  const PixelFormat raymap_format_;
  std::array<std::optional<Format>, kMaxHeads> formats_;
  InTake in_take_;
  std::array<Instant, kMaxHeads> since_;  ///< when the stream in the take began
};

}  // namespace nodal::firmware
