// Blends one frame set into one raymap.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"
#include "stitch/blend/tone.h"

namespace nodal::blend {

/// The heads' pictures of one set: that of head h at pyramid level l is pictures[l * heads + h]; levels no source has
/// (Source::levels) may be left out. A head that is missing has planes[0].data == nullptr at level 0. Planes are read
/// where they lie, whatever their strides.
using Pictures = std::span<const ImageView>;

/// Blends one frame set into rows [row_begin, row_end) of the raymap. row_begin is even where chroma is halved, row_end
/// too unless it is the last; whole multiples of 64 are quickest. With mulr(a, b) = (a * b + 2^14) >> 15 in exact
/// arithmetic, of one component of pixel (i, j) of a tile:
///
///   for each of the tile's records:
///     X, Y      = the pixel's place in the patch; x = X >> 12, f = X >> 5 & 127, y = Y >> 12, g = Y & 4095
///     t, b      = s(x, y) (128 - f) + s(x + 1, y) f, the same of row y + 1;  s: samples of the patch, 0 .. 255
///     sample    = t - mulr(t - b, 8 g)                           0 .. kMaxSample
///     negative  = 128 black - curve(sample)                      curve: HeadTone's. Light and weights are kept
///     negative  = mulr(negative, gain)                           negative, so that a weight of exactly one fits into
///     light    += mulr(negative, -weight)                        16 bits. gain (if gains act) = mulr(vignetting's, HeadTone's)
///   level       = black + mulr(light, scale), or curve(light) + 64 >> 7, clamped to 0 .. 255
///   or, of raymaps of 16 bits: number = table.linear[light], 0 for light below 0
///
/// where `gain` is HeadTone's alone for tables without vignetting gains. Weights w are those of the table; where a
/// head that looks at the tile is missing, or SetTone::confidence is there and the tile has several records, they are
/// (w c 2^15 + W / 2) / W, rounded down, W the sum of w c over the tile's records, c the confidence, or 1, and 0 of a
/// head that is missing; black where W is 0. c goes by the sample of the pixel itself before any curve or gain (the
/// largest of R G B); for chroma by the luma sample nearest to the chroma sample (x, y) of the pixel.
///
/// After that, where SetTone::fade is there, chroma is 128 + ((chroma - 128) fade.of_luma[m] + 128 >> 8), m the mean of
/// its four luma samples, halves up; beyond odd edges the edge is repeated. Not in raymaps whose rays were sorted into
/// tiles (GridTable::places): there the four have nothing to do with each other, nor has one's chroma with the others.
/// Of those, rows are rows of tiles as they were sorted, and their pixels lie anywhere in the raymap: it is whole when
/// all rows have been blended.
///
/// The table has been validated, every head's picture is what table.sources says, prepared as prepare.h says where the
/// source needs it, and the raymap what table.format says (of 16 bits: packed in each row); nothing is checked
/// here. The fastest kernel of this processor runs; all kernels give the same bytes.
///
/// Threading: thread-safe; call with disjoint rows from as many threads as you like: any split gives the same
/// bytes.
/// Ownership: none. Allocates nothing.
/// Errors: none.
void blend_rows(const BlendTable& table, Pictures pictures, const SetTone& tone, const MutableImageView& raymap,
                int row_begin, int row_end);

/// The share of each raymap pixel's weight whose heads are present, for rows [row_begin, row_end): 255 where no
/// head is missing, 0 where all are (the pixel is black), else 1 .. 254. Of the pictures it reads only whether
/// pictures[h].planes[0].data of level 0 is null.
///
/// Threading, ownership, errors: as blend_rows. `validity` has the raymap's size.
void validity_rows(const BlendTable& table, Pictures pictures, const MutablePlaneView& validity, int row_begin,
                   int row_end);

/// The implementations of the blend.
enum class Kernel : std::uint8_t { kScalar, kAvx2, kAvx512, kNeon };
std::string_view kernel_name(Kernel kernel);
/// Those that run on this processor, slowest first; blend_rows uses the last.
std::span<const Kernel> kernels();
/// blend_rows by one of kernels(): for tests, which compare them, and for measurements.
void blend_rows_by(Kernel kernel, const BlendTable& table, Pictures pictures, const SetTone& tone,
                   const MutableImageView& raymap, int row_begin, int row_end);

}  // namespace nodal::blend
