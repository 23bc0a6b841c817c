#include "hal/linux/v4l2/field_weaver.h"

#include <algorithm>
#include <utility>

namespace nodal::hal::v4l2 {

FieldWeaver::FieldWeaver(const HeadFormat& format, int buffers)
    : format_(format), buffers_(static_cast<std::size_t>(buffers)) {
  for (Buffer& buffer : buffers_) buffer.bytes.resize(packed_size(format.pixels, format.width, format.height));
}

void FieldWeaver::copy(const Field& field, BufferSlot slot) {
  const MutableImageView frame =
      packed_image(format_.pixels, format_.width, format_.height, buffers_[slot].bytes.data());
  const MutableImageView into = field_of(frame, field.parity);
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(format_.pixels)); ++c) {
    const PlaneView& from = field.image.planes[c];
    const MutablePlaneView& to = into.planes[c];
    for (int y = 0; y < to.height; ++y) {
      const std::uint8_t* read = from.data + y * from.row_stride;
      std::uint8_t* write = to.data + y * to.row_stride;
      if (from.pixel_stride == 1) {
        std::copy_n(read, to.width, write);
        continue;
      }
      for (int x = 0; x < to.width; ++x) write[x * to.pixel_stride] = read[x * from.pixel_stride];
    }
  }
}

FieldWeaver::Frame FieldWeaver::lend(const Half& half, Fields fields) {
  buffers_[half.slot].state = State::kLent;
  const std::uint8_t* const bytes = buffers_[half.slot].bytes.data();
  return {half.slot, half.sequence, fields, packed_image(format_.pixels, format_.width, format_.height, bytes)};
}

std::optional<FieldWeaver::Frame> FieldWeaver::put(const Field& field) {
  const auto before = std::exchange(half_, std::nullopt);
  if (before && before->sequence == field.sequence && before->parity != field.parity) {
    copy(field, before->slot);
    return lend(*before, fields_from(before->parity));
  }
  const auto free =
      std::find_if(buffers_.begin(), buffers_.end(), [](const Buffer& buffer) { return buffer.state == State::kFree; });
  if (free != buffers_.end()) {
    free->state = State::kFilling;
    half_ = Half{static_cast<BufferSlot>(free - buffers_.begin()), field.sequence, field.parity};
    copy(field, half_->slot);
  }
  if (!before) return std::nullopt;
  return lend(*before, before->parity == FieldParity::kTop ? Fields::kTopOnly : Fields::kBottomOnly);
}

void FieldWeaver::release(BufferSlot slot) {
  if (slot < buffers_.size() && buffers_[slot].state == State::kLent) buffers_[slot].state = State::kFree;
}

void FieldWeaver::drop_unfinished() {
  if (half_) buffers_[half_->slot].state = State::kFree;
  half_.reset();
}

void FieldWeaver::take_back() {
  half_.reset();
  for (Buffer& buffer : buffers_) buffer.state = State::kFree;
}

}  // namespace nodal::hal::v4l2
