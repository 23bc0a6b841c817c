// A head's low picture: its low frequencies, for two bands (low_band.h). Internal to stitch/blend.
#pragma once

#include <cstdint>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"

namespace nodal::blend {

/// A sample of a low picture: of some rows of the squares around it, see make_low_picture().
struct LowSample {
  std::uint16_t mean = 0;   ///< mean level in 1/128, rounded half up
  std::uint8_t least = 0;   ///< level of the darkest sample
  std::uint8_t most = 255;  ///< level of the brightest sample
};
static_assert(sizeof(LowSample) == 4);

/// Rows and columns beyond the right and the lower edge that repeat the edge sample. So four samples can be read from
/// any LowSight on: those of chroma may lie one sample beyond a low picture of luma whose size is odd.
inline constexpr int kMoreLowSamples = 2;

/// The low picture of a picture of the shape `read`, in `memory`: a plane of LowSample for each component, with as many
/// samples as the component has whole squares, one at least, and kMoreLowSamples more in memory. ImageView::bytes is
/// what it takes in all.
ImageView low_picture(const BlendTable::Source& source, const ImageView& read, const std::uint8_t* memory);

/// Makes it. A square has n x n samples, n = Source::low_size, or half of it in the chroma of subsampled formats. Of
/// each, rows n/4 and 3n/4 are read; beyond the picture's edge the edge sample is repeated. Then 3 x 3 squares are
/// combined, beyond the low picture's edge with the edge square again: their darkest and brightest sample, and the mean
/// with weights (1 2 1) / 4 along rows, then along columns, each rounded half up. Without these weights the means of
/// two heads, whose squares lie differently on the scene, differ by its detail.
void make_low_picture(const BlendTable::Source& source, const ImageView& read, std::uint8_t* memory);

}  // namespace nodal::blend
