// Interlaced pictures: two fields of alternate rows, exposed one after the other.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "protocol/base/image.h"

namespace nodal {

/// Which rows of a picture hold samples, and which field was exposed first.
enum class Fields : std::uint8_t {
  kProgressive = 0,  ///< one exposure
  kTopFirst = 1,     ///< rows 0, 2, 4… half a frame period before rows 1, 3, 5…
  kBottomFirst = 2,  ///< rows 1, 3, 5… first, as in NTSC DV
  kTopOnly = 3,      ///< rows 0, 2, 4… arrived, the others are missing
  kBottomOnly = 4,
};

/// The word for it in rig.toml, in takes and in messages.
constexpr std::string_view fields_name(Fields fields) {
  switch (fields) {
    case Fields::kProgressive: break;
    case Fields::kTopFirst: return "top-first";
    case Fields::kBottomFirst: return "bottom-first";
    case Fields::kTopOnly: return "top-only";
    case Fields::kBottomOnly: return "bottom-only";
  }
  return "progressive";
}
/// The order that a whole frame can have. Empty for any other word.
constexpr std::optional<Fields> fields_named(std::string_view name) {
  for (const Fields fields : {Fields::kProgressive, Fields::kTopFirst, Fields::kBottomFirst}) {
    if (name == fields_name(fields)) return fields;
  }
  return std::nullopt;
}

enum class FieldParity : std::uint8_t { kTop = 0, kBottom = 1 };

constexpr std::string_view field_parity_name(FieldParity parity) {
  return parity == FieldParity::kTop ? "top" : "bottom";
}

constexpr FieldParity first_field(Fields fields) {
  return fields == Fields::kBottomFirst ? FieldParity::kBottom : FieldParity::kTop;
}
/// The fields of a frame with both; `first` was exposed first.
constexpr Fields fields_from(FieldParity first) {
  return first == FieldParity::kTop ? Fields::kTopFirst : Fields::kBottomFirst;
}
constexpr FieldParity other(FieldParity parity) {
  return parity == FieldParity::kTop ? FieldParity::kBottom : FieldParity::kTop;
}

/// A view of one field in its frame: the rows of that parity of every component, so rows of vertically halved chroma
/// alternate between the fields. The frame's height is even, and a multiple of four where chroma is halved.
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

/// The position of component c's samples of a field in the whole frame.
inline PlaneGrid field_grid(PixelFormat format, int c, FieldParity parity) {
  PlaneGrid grid = component_grid(format, c);
  // Field row r is frame row 2 r + parity; both are measured from their picture's upper edge.
  grid.offset_y += (parity == FieldParity::kTop ? 0.25 : -0.25) / grid.step_y;
  grid.step_y *= 2;
  return grid;
}

}  // namespace nodal
