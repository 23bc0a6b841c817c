// Interlaced pictures: two fields, every other row each, exposed one after the other.
#pragma once

#include <cstdint>
#include <string_view>

#include "protocol/base/image.h"

namespace nodal {

/// What the rows of a picture are, and which were exposed first.
enum class Fields : std::uint8_t {
  kProgressive = 0,  ///< one exposure
  kTopFirst = 1,     ///< rows 0, 2, 4… half a frame period before rows 1, 3, 5…
  kBottomFirst = 2,  ///< the other way round, as NTSC's DV has it
  kTopOnly = 3,      ///< rows 0, 2, 4… came, the others did not
  kBottomOnly = 4,
};

enum class FieldParity : std::uint8_t { kTop = 0, kBottom = 1 };

constexpr std::string_view field_parity_name(FieldParity parity) {
  return parity == FieldParity::kTop ? "top" : "bottom";
}

constexpr FieldParity first_field(Fields fields) {
  return fields == Fields::kBottomFirst ? FieldParity::kBottom : FieldParity::kTop;
}
/// Both fields came, `first` exposed first.
constexpr Fields fields_from(FieldParity first) {
  return first == FieldParity::kTop ? Fields::kTopFirst : Fields::kBottomFirst;
}
constexpr FieldParity other(FieldParity parity) {
  return parity == FieldParity::kTop ? FieldParity::kBottom : FieldParity::kTop;
}

/// One field where it lies in its frame: every component's rows of that parity, so that chroma that is halved
/// vertically belongs to the fields in turns. The frame's height is even, and a multiple of four where chroma is halved.
template <class Byte>
BasicImageView<Byte> field_of(BasicImageView<Byte> frame, FieldParity parity) {
  frame.height /= 2;
  for (BasicPlaneView<Byte>& plane : frame.planes) {
    if (plane.data == nullptr) continue;
    if (parity == FieldParity::kBottom) plane.data += plane.row_stride;
    plane.row_stride *= 2;
    plane.height /= 2;
  }
  return frame;
}

/// Where component c's samples of a field lie on the whole frame's picture.
inline PlaneGrid field_grid(PixelFormat format, int c, FieldParity parity) {
  PlaneGrid grid = component_grid(format, c);
  // Field row r is frame row 2 r + parity; both count from their pictures' upper edges.
  grid.offset_y += (parity == FieldParity::kTop ? 0.25 : -0.25) / grid.step_y;
  grid.step_y *= 2;
  return grid;
}

}  // namespace nodal
