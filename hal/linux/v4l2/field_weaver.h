// Frames of interlaced heads whose drivers deliver each field by itself.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "hal/head.h"
#include "protocol/base/field.h"

namespace nodal::hal::v4l2 {

/// Copies fields into buffers of its own, row by row, so that the driver has its buffers back at once and everything
/// behind the port sees whole frames.
///
/// Threading: thread-bound.
/// Ownership: owns the frames' memory; a frame stays valid until release() or take_back().
/// Errors: none.
class FieldWeaver {
 public:
  /// One field as it arrived.
  struct Field {
    FieldParity parity = FieldParity::kTop;
    std::uint32_t sequence = 0;  ///< both fields of a frame have the same
    ImageView image;
  };
  /// A frame of which both fields arrived, or one that another frame's field has ended.
  struct Frame {
    BufferSlot slot = 0;
    std::uint32_t sequence = 0;
    Fields fields = Fields::kTopOnly;
    ImageView image;
  };

  /// Weaves frames of this format in `buffers` buffers.
  FieldWeaver(const HeadFormat& format, int buffers);

  /// Copies the field. Returns the frame that is finished by it: its own, or the one before, of which one field is
  /// missing. Without a free buffer the field is discarded.
  std::optional<Frame> put(const Field& field);
  void release(BufferSlot slot);
  /// Discards the frame of which only one field has arrived.
  void drop_unfinished();
  /// Takes back every frame, too.
  void take_back();

 private:
  enum class State : std::uint8_t { kFree, kFilling, kLent };
  struct Buffer {
    std::vector<std::uint8_t> bytes;
    State state = State::kFree;
  };
  struct Half {
    BufferSlot slot = 0;
    std::uint32_t sequence = 0;
    FieldParity parity = FieldParity::kTop;
  };
  void copy(const Field& field, BufferSlot slot);
  Frame lend(const Half& half, Fields fields);

  const HeadFormat format_;
  std::vector<Buffer> buffers_;
  std::optional<Half> half_;
};

}  // namespace nodal::hal::v4l2
