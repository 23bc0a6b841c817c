// The input and output of the blend's variants, frame by frame: more memory than the caches hold.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "measure.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/prepare.h"
#include "stitch/table/options.h"
#include "tests/bench/workloads.h"

namespace nodal::bench {

/// Several copies of the pictures in one format.
class Films {
 public:
  Films(const Calibration& rig, PixelFormat format, std::size_t count) {
    sets_.push_back(film(rig, format, 1));
    while (sets_.size() < count) sets_.push_back(copy(sets_.front()));
  }
  const FilmedSet& at(std::size_t set) const { return sets_[set % sets_.size()]; }

 private:
  std::vector<FilmedSet> sets_;
};

/// Raymaps to write to; rows begin at multiples of 64 bytes.
class Outputs {
 public:
  Outputs(PixelFormat format, int width, int height) {
    for (auto& memory : memory_) {
      memory.resize(packed_size(format, width, height) + 64);
      const auto at = (reinterpret_cast<std::uintptr_t>(memory.data()) + 63) / 64 * 64;
      images_.push_back(packed_image(format, width, height, reinterpret_cast<std::uint8_t*>(at)));
    }
  }
  const MutableImageView& at(std::size_t set) const { return images_[set % images_.size()]; }

 private:
  std::array<std::vector<std::uint8_t>, 3> memory_;
  std::vector<MutableImageView> images_;
};

/// Sharpened and downscaled pictures of the heads, for tables that use them, in memory that is reused for every frame.
class Levels {
 public:
  explicit Levels(const blend::BlendTable& table) : table_(table), views_(table.sources.size() * blend::kMaxPictures) {
    for (const blend::BlendTable::Source& source : table.sources) memory_.emplace_back(blend::prepared_size(source));
  }
  blend::Pictures make(std::span<const ImageView> heads, Pool& pool) {
    pool.run(static_cast<int>(heads.size()), [&](int head) {
      const auto h = static_cast<std::size_t>(head);
      std::array<ImageView, blend::kMaxPictures> levels;
      blend::prepare_picture(table_.sources[h], heads[h], memory_[h].data(), levels);
      for (std::size_t l = 0; l < table_.sources[h].pictures(); ++l) views_[l * heads.size() + h] = levels[l];
    });
    return views_;
  }

 private:
  const blend::BlendTable& table_;
  std::vector<std::vector<std::uint8_t>> memory_;
  std::vector<ImageView> views_;
};

/// The options for speed measurements unless stated otherwise: with feathers, for comparison with older figures;
/// without sharpening; `light` adds tone curves and gains.
inline table::TableOptions options_of(bool light) {
  table::TableOptions options;
  options.transition = Transition::kFeather;
  options.sharpen = 0;
  options.undo_vignetting = options.undo_gain = light;
  return options;
}

/// An identity curve for every head: it costs as much as any other curve.
inline void add_curves(blend::SetTone& tone) {
  for (blend::HeadTone& head : tone.heads) {
    auto& knots = head.curve[0].emplace().knots;
    for (std::size_t i = 0; i < knots.size(); ++i) {
      knots[i] = static_cast<std::int16_t>(std::min<int>(static_cast<int>(i) << 10, blend::kMaxSample));
    }
  }
}

/// Blends a whole raymap in bands.
inline void blend_frame(blend::Kernel kernel, const blend::BlendTable& table, blend::Pictures pictures,
                        const blend::SetTone& tone, const MutableImageView& raymap, Pool& pool) {
  constexpr int kRows = 64;
  pool.run((table.height + kRows - 1) / kRows, [&](int band) {
    blend::blend_rows_by(kernel, table, pictures, tone, raymap, band * kRows,
                         std::min(table.height, (band + 1) * kRows));
  });
}

inline double table_bytes(const blend::BlendTable& table) {
  double bytes = 0;
  for (const blend::GridTable& g : table.grids) {
    bytes += static_cast<double>(g.tiles.size() * sizeof g.tiles[0] + g.records.size() * sizeof g.records[0] +
                                 g.weights.size() * 2 + g.coordinates.size() * 2 + g.gains.size() * 8 +
                                 g.places.size() * 4 + g.batches.size() * sizeof(blend::GridTable::Batch) +
                                 g.runs.size() * sizeof(blend::GridTable::Run) + g.slots.size() * 2);
  }
  return bytes;
}

}  // namespace nodal::bench
