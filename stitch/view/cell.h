// A square of the target's pixels whose positions in the raymap are a polynomial: it is sampled in integers.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/base/image.h"
#include "stitch/geometry/biquadratic.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/view/filter.h"
#include "stitch/view/pieces.h"
#include "stitch/view/row_kernel.h"
#include "stitch/view/target.h"

namespace nodal::view {

/// How many samples a pixel needs along an axis on which it covers `pixels` of the raymap.
int samples_for(double pixels);

/// Threading: immutable; any thread.
class Cell {
 public:
  static constexpr int kSide = geometry::Biquadratic<2>::kSide;
  /// Most samples along each side of a pixel.
  static constexpr int kMaxSamples = 8;

  /// The cell whose first pixel is (left, top). Nothing unless its positions are a polynomial to within 1/64 px, and
  /// all pixels that its samples need are one piece of the raymap.
  static std::optional<Cell> make(const Target& target, const geometry::RaymapLayout& layout, const Pieces& pieces,
                                  const Taps& taps, int left, int top);

  /// Writes kSide x kSide pixels of 8 or 16 bits a sample, packed in rows `stride` bytes apart.
  template <class Sample>
  void write(const PlaneView& raymap, int channels, const Taps& taps, RowKernelOf<Sample> kernel, std::uint8_t* to,
             std::ptrdiff_t stride) const;

 private:
  Curve curve(double i, double j) const;
  void expand();
  bool covers_one_piece(const Pieces& pieces, const Taps& taps);

  geometry::Biquadratic<2> at_;  ///< px, relative to the centre of the base pixel
  /// The same as coefficients, for x and for y: matrix rows are powers of the column, matrix columns powers of the row.
  std::array<Eigen::Matrix3d, 2> powers_;
  std::int32_t base_x_ = 0, base_y_ = 0;
  std::uint8_t across_ = 1, down_ = 1;  ///< samples per pixel
};

}  // namespace nodal::view
