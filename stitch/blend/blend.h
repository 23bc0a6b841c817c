// Blends one frame set into one raymap.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"
#include "stitch/blend/tone.h"

namespace nodal::blend {

/// The pictures of one set: head h at pyramid level l is pictures[l * heads + h]; its low picture, if it has one,
/// follows as level Source::levels. Levels that no head has may be left out. A missing head has planes[0].data ==
/// nullptr at level 0. Planes are read in place, with any stride.
using Pictures = std::span<const ImageView>;

/// Blends one frame set into rows [row_begin, row_end) of the raymap. If chroma is subsampled vertically, row_begin is
/// even, and row_end is even or the last row. Multiples of 64 rows are fastest. For one component of pixel (i, j) of a
/// tile, with mulr(a, b) = (a * b + 2^14) >> 15 in exact arithmetic:
///
///   for each of the tile's records:
///     X, Y      = the pixel's coordinates in the patch; x = X >> 12, f = X >> 5 & 127, y = Y >> 12, g = Y & 4095
///     t, b      = s(x, y) (128 - f) + s(x + 1, y) f, and the same for row y + 1;  s: samples of the patch, 0 .. 255
///     sample    = t - mulr(t - b, 8 g)                           0 .. kMaxSample
///     negative  = 128 black - curve(sample)                      curve: HeadTone's. Light and weights are stored
///     negative  = mulr(negative, gain)                           negative, as a weight of exactly one then fits into
///     negative += mulr(q, 2^13), clamped to +-kMaxSample         16 bits. gain: mulr(vignetting's, HeadTone's), if any
///     light    += mulr(negative, -weight)                        q: LowBand::coefficients at (i, j), if two bands
///   level       = black + mulr(light, scale), or (curve(light) + 64) >> 7, clamped to 0 .. 255
///   or, for 16-bit raymaps: number = table.linear[light], 0 for light below 0
///
/// where `gain` is HeadTone's alone for tables without vignetting gains. The weights w come from the table. In tiles
/// with a missing head, and, if SetTone::confidence is set, in tiles with several records (a pair is one), w becomes
/// (w c 2^15 + W / 2) / W, rounded down; W is the sum of w c over the tile's records; the pixel is black where W is 0.
/// c is the head's confidence (0: missing; 1: no confidence set) by the pixel's own sample before curve and gain (the
/// largest of R G B); for chroma, by the luma sample nearest to chroma sample (x, y).
///
/// Where the table has a cover (BlendTable::cover), its records take what the tile's own lack: with C the confidence of
/// a head without doubt (255; 1 if no confidence is set), S the sum of w over the tile's own records, and V the sum of
/// w c over the cover's, where V is not 0,
///
///   own records:    (w c 2^15 + C S / 2) / (C S)
///   cover records:  (w c (C S - W) 2^15 + C S V / 2) / (C S V)
///
/// If SetTone::fade is set, chroma then becomes 128 + ((chroma - 128) fade.of_luma[m] + 128 >> 8); m is the mean of its
/// four luma samples, rounded half up; at odd edges the edge sample is repeated. Not in raymaps whose rays were sorted
/// into tiles (GridTable::places), because their neighbouring pixels need not have neighbouring rays. For those, rows
/// count rows of tiles, and a tile's pixels can be anywhere, so the raymap is complete only after all rows have been
/// blended. Of batches (GridTable::batches) a call blends those whose first tile is in its rows, if tiles are counted
/// row by row.
///
/// Preconditions, not checked here: the table is validated; every head's picture matches table.sources, prepared as in
/// prepare.h where its source needs that; the raymap matches table.format (16-bit rows are packed). The fastest kernel
/// that this processor supports runs; all kernels give the same bytes.
///
/// Threading: thread-safe. Call it with disjoint rows from any number of threads: every split gives the same
/// bytes.
/// Ownership: none. Allocates nothing.
/// Errors: none.
void blend_rows(const BlendTable& table, Pictures pictures, const SetTone& tone, const MutableImageView& raymap,
                int row_begin, int row_end);

/// The share of each raymap pixel's weight that comes from present heads, for rows [row_begin, row_end): 255 where no
/// head is missing, 0 where all are missing (the pixel is black), else 1 .. 254. What a cover replaces counts by the
/// share of its weight that is there. Of `pictures` it reads only whether pictures[h].planes[0].data of level 0 is
/// null.
///
/// Threading, ownership, errors: as blend_rows. `validity` has the raymap's size.
void validity_rows(const BlendTable& table, Pictures pictures, const MutablePlaneView& validity, int row_begin,
                   int row_end);

/// The implementations of the blend.
enum class Kernel : std::uint8_t { kScalar, kAvx2, kAvx512, kNeon };
std::string_view kernel_name(Kernel kernel);
/// The kernels that this processor supports, slowest first; blend_rows uses the last.
std::span<const Kernel> kernels();
/// blend_rows with a given kernel out of kernels(): for tests, which compare kernels, and for measurements.
void blend_rows_by(Kernel kernel, const BlendTable& table, Pictures pictures, const SetTone& tone,
                   const MutableImageView& raymap, int row_begin, int row_end);

}  // namespace nodal::blend
