// The specification of the blend, one pixel at a time. See blend.h for the formulas.
#include "stitch/blend/tile_driver.h"

namespace nodal::blend {
namespace {

struct Scalar {
  template <int N, class Number>
  static void tile(const BlendJob& job, const Tile& tile, std::size_t records, Number* out) {
    std::array<TileValues, N> light{};
    std::array<TileValues, N> negative_light;
    Weights weights;
    WeightReader reader(*job.grid, tile, records);
    for (std::size_t r = tile.record; r < tile.record + records; ++r) {
      reader.next(weights);
      samples<N>(job, *job.grid, job.grid->records[r], negative_light);
      for (std::size_t c = 0; c < N; ++c) {
        for (int j = 0; j < kTile; ++j) {
          for (int i = 0; i < kTile; ++i) {
            const auto p = static_cast<std::size_t>(j * kTile + i);
            if (weights[p] == 0) continue;  // its sample and its gain are any number
            light[c][p] = wrap(light[c][p] + mulr(negative_light_of(job, *job.grid, r, c, negative_light[c][p], i, j),
                                                  wrap(-weights[p])));
          }
        }
      }
    }
    for (std::size_t c = 0; c < N; ++c) finish_tile(job, c, light[c], out + c * kStrip);
  }

  template <int N>
  static void samples(const BlendJob& job, const GridTable& grid, const PatchRecord& record,
                      std::array<TileValues, N>& samples) {
    const PatchPlane& plane = job.plane(record);
    for (int j = 0; j < kTile; ++j) {
      for (int i = 0; i < kTile; ++i) {
        const Place at = place_of(grid, record, i, j);
        const auto p = static_cast<std::size_t>(j * kTile + i);
        for (std::size_t c = 0; c < N; ++c) samples[c][p] = wrap(sample_at(plane.views[c], record, at));
      }
    }
  }

  template <int N>
  static bool emit(const BlendJob&, int, int, const std::uint8_t*, const RowEnds&) {
    return false;
  }

  static void put(std::uint8_t* to, const std::uint8_t* from, std::size_t bytes) { std::memcpy(to, from, bytes); }
};

}  // namespace

void blend_scalar(const BlendJob& job) { blend_by<Scalar>(job); }

}  // namespace nodal::blend
