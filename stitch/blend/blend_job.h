// The data of one call of blend_rows that every kernel needs, computed once per call. Internal to stitch/blend.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "stitch/blend/blend.h"

namespace nodal::blend {

/// How the samples of a grid's components are stored in a picture. Groups: one load fetches all components of a sample.
enum class SampleLayout : std::uint8_t {
  kPlanar,   ///< each component in its own plane, samples contiguous
  kPairs,    ///< groups of 2 bytes: luma of YUYV and UYVY, chroma of NV12
  kTriples,  ///< groups of 3 bytes: RGB24
  kQuads,    ///< groups of 4 bytes: chroma of YUYV and UYVY
  kGeneral,  ///< read by PlaneView, sample by sample; also pictures smaller than a patch
};

/// A head's picture at one pyramid level, as one grid's patches are read from it.
struct PatchPlane {
  std::array<const std::uint8_t*, kMaxPlanes> data{};  ///< by component of the grid; for groups [0] is the first group
  std::array<std::uint8_t, kMaxPlanes> offset{};       ///< byte offset of the component in its group
  std::ptrdiff_t row_stride = 0;
  int group = 1;  ///< bytes from one sample to the next
  SampleLayout layout = SampleLayout::kPlanar;
  std::array<PlaneView, kMaxPlanes> views{};  ///< by component of the grid
};

/// A 16-bit number stored twice side by side: one 32-bit broadcast fills a register with it.
class RepeatedInt16 {
 public:
  constexpr RepeatedInt16(int number = 0) : both_(static_cast<std::uint32_t>(number & 0xffff) * 0x10001U) {}
  constexpr operator std::int16_t() const { return static_cast<std::int16_t>(both_ & 0xffff); }
  constexpr int both() const { return static_cast<int>(both_); }

 private:
  std::uint32_t both_;
};

/// A ToneCurve or OutputCurve as a lookup table: value = knot[i] + mulr(rise[i], fraction). The fraction includes the
/// lowest bit of the piece's index as its sign, so the fraction of an odd piece counts back from the piece's end, and
/// `knot` is the value at that end.
template <std::size_t kPieces>
struct Pieces {
  alignas(64) std::array<std::int16_t, kPieces> knot;
  alignas(64) std::array<std::int16_t, kPieces> rise;
  alignas(64) std::array<std::int16_t, kPieces> negative_knot;  ///< black minus the knot
  /// The same for kernels that look up bytes: low and high bytes of knot, then of rise.
  alignas(64) std::array<std::array<std::uint8_t, kPieces>, 4> bytes;

  void set(std::size_t i, std::int16_t start, std::int16_t rise_i, std::int16_t black) {
    const auto knot_i = static_cast<std::int16_t>(start + (i % 2 == 0 ? 0 : rise_i));
    knot[i] = knot_i;
    negative_knot[i] = static_cast<std::int16_t>(black - knot_i);
    rise[i] = rise_i;
    bytes[0][i] = static_cast<std::uint8_t>(knot_i & 255);
    bytes[1][i] = static_cast<std::uint8_t>(knot_i >> 8 & 255);
    bytes[2][i] = static_cast<std::uint8_t>(rise_i & 255);
    bytes[3][i] = static_cast<std::uint8_t>(rise_i >> 8 & 255);
  }
};

/// Constants of one component of the grid.
struct JobComponent {
  int component = 0;    ///< index in the raymap's format
  RepeatedInt16 black;  ///< 128 * ComponentRule::black
  RepeatedInt16 black_level;
  std::uint8_t tone = 0;
  RepeatedInt16 scale;           ///< factor of light; OutputTone::scale
  RepeatedInt16 negative_scale;  ///< -scale
  bool output_curve = false;
};

class LowBand;

/// One grid's part of a call.
struct BlendJob {
  const BlendTable* table = nullptr;
  const GridTable* grid = nullptr;
  const GridTable* cover = nullptr;  ///< BlendTable::cover's of the same grid, if there is one
  const SetTone* tone = nullptr;
  bool gains = false;         ///< whether any gain is applied
  bool curves = false;        ///< whether any head has a curve
  bool careful = false;       ///< whether confidence is used
  std::uint32_t missing = 0;  ///< missing heads, one bit each
  int components = 0;
  std::array<JobComponent, kMaxPlanes> component{};
  std::array<std::array<PatchPlane, kMaxHeads>, kMaxLevels> planes{};
  std::array<std::array<PlaneView, kMaxHeads>, kMaxLevels> luma{};  ///< luma planes, used for confidence
  std::array<ImageView, kMaxHeads> low{};                           ///< low pictures of the heads
  LowBand* low_band = nullptr;                                      ///< null without two bands
  /// Per head, shifts from chroma to luma coordinates: a chroma sample (x, y) has luma (x << right, y << down).
  std::array<std::array<std::uint8_t, 2>, kMaxHeads> luma_shift{};
  std::array<std::array<Pieces<32>, kToneClasses>, kMaxHeads> curve;
  std::array<std::array<RepeatedInt16, kToneClasses>, kMaxHeads> gain_of{};
  std::array<Pieces<64>, kToneClasses> output;
  std::array<MutablePlaneView, kMaxPlanes> out{};  ///< by component of the grid
  int row_begin = 0;                               ///< first row of the call, in rows of the grid
  int row_end = 0;

  const PatchPlane& plane(const PatchRecord& record) const {
    return planes[static_cast<std::size_t>(record.pyramid_level())][record.head()];
  }
  RepeatedInt16 gain(HeadIndex head, std::size_t c) const { return gain_of[head][component[c].tone]; }
};

/// Fills in `job` for grid g of the call.
void make_job(const BlendTable& table, std::size_t g, Pictures pictures, const SetTone& tone,
              const MutableImageView& raymap, int row_begin, int row_end, BlendJob& job);

void blend_scalar(const BlendJob& job);
void blend_avx2(const BlendJob& job);
void blend_avx512(const BlendJob& job);
void blend_neon(const BlendJob& job);

}  // namespace nodal::blend
