#include "stitch/blend/blend_job.h"

#include <algorithm>

namespace nodal::blend {
namespace {

/// How the components in views[0 .. count) are stored; `format` gives the byte order of packed luma and chroma.
PatchPlane patch_plane(const std::array<PlaneView, kMaxPlanes>& views, std::size_t count, PixelFormat format) {
  PatchPlane plane{{}, {}, views[0].row_stride, views[0].pixel_stride, SampleLayout::kGeneral, views};
  bool alike = true;
  for (std::size_t c = 0; c < count; ++c) {
    plane.data[c] = views[c].data;
    alike = alike && views[c].row_stride == views[0].row_stride && views[c].pixel_stride == plane.group;
  }
  if (!alike || views[0].width < kPatch || views[0].height < kPatch) return plane;
  const auto grouped = [&](SampleLayout layout, std::uint8_t first, std::uint8_t step) {
    for (std::size_t c = 0; c < count; ++c) {
      if (views[c].data != views[0].data + c * step) return;
      plane.offset[c] = static_cast<std::uint8_t>(first + c * step);
    }
    plane.data[0] -= first;
    plane.layout = layout;
  };
  const bool luma_second = format == PixelFormat::kUyvy;
  const bool packed = luma_second || format == PixelFormat::kYuyv;
  if (plane.group == 1) {
    plane.layout = SampleLayout::kPlanar;
  } else if (plane.group == 2 && count == 1 && packed) {
    grouped(SampleLayout::kPairs, luma_second ? 1 : 0, 0);
  } else if (plane.group == 2 && count == 2) {
    grouped(SampleLayout::kPairs, 0, 1);
  } else if (plane.group == 3 && count == 3) {
    grouped(SampleLayout::kTriples, 0, 1);
  } else if (plane.group == 4 && count == 2 && packed) {
    grouped(SampleLayout::kQuads, luma_second ? 0 : 1, 2);
  }
  return plane;
}

template <std::size_t kPieces, class Knots>
void expand(const Knots& knots, std::int16_t black, Pieces<kPieces>& pieces) {
  static_assert(std::tuple_size_v<Knots> == kPieces + 1);
  for (std::size_t i = 0; i < kPieces; ++i) {
    pieces.set(i, static_cast<std::int16_t>(knots[i]), static_cast<std::int16_t>(knots[i + 1] - knots[i]), black);
  }
}

void expand_tone(const SetTone& tone, BlendJob& job) {
  job.tone = &tone;
  job.careful = tone.confidence.has_value();
  job.gains = tone.gains || !job.grid->gains.empty();
  job.curves = false;
  ToneCurve same;
  for (std::size_t i = 0; i < same.knots.size(); ++i) same.knots[i] = static_cast<std::uint16_t>(i << 10);
  std::uint32_t classes = 0;
  std::array<std::int16_t, kToneClasses> black{};
  for (std::size_t c = 0; c < static_cast<std::size_t>(job.components); ++c) {
    classes |= 1U << job.component[c].tone;
    black[job.component[c].tone] = job.component[c].black;
  }
  for (std::size_t h = 0; h < job.table->sources.size(); ++h) {
    for (std::size_t k = 0; k < kToneClasses; ++k) {
      job.curves |= (classes >> k & 1) != 0 && tone.heads[h].curve[k];
      job.gain_of[h][k] = tone.heads[h].gain[k];
    }
  }
  if (job.curves) {
    for (std::size_t h = 0; h < job.table->sources.size(); ++h) {
      for (std::size_t k = 0; k < kToneClasses; ++k) {
        expand<32>(tone.heads[h].curve[k].value_or(same).knots, black[k], job.curve[h][k]);
      }
    }
  }
  for (std::size_t k = 0; k < kToneClasses; ++k) {
    if (tone.output[k].curve) expand<64>(tone.output[k].curve->knots, 0, job.output[k]);
  }
}

}  // namespace

void make_job(const BlendTable& table, std::size_t g, Pictures pictures, const SetTone& tone,
              const MutableImageView& raymap, int row_begin, int row_end, BlendJob& job) {
  const GridTable& grid = table.grids[g];
  job.table = &table;
  job.grid = &grid;
  job.cover = table.cover.empty() ? nullptr : &table.cover[g];
  job.row_begin = (row_begin + grid.row_step - 1) / grid.row_step;
  job.row_end = (row_end + grid.row_step - 1) / grid.row_step;
  job.components = 0;
  for (int c = 0; c < component_count(table.format); ++c) {
    const ComponentRule& rule = table.components[static_cast<std::size_t>(c)];
    if (rule.grid != g) continue;
    const OutputTone& output = tone.output[rule.tone];
    const auto slot = static_cast<std::size_t>(job.components++);
    job.component[slot] = {
        c, rule.black << kSampleBits, rule.black, rule.tone, output.scale, -output.scale, output.curve.has_value()};
    job.out[slot] = raymap.planes[static_cast<std::size_t>(c)];
  }
  expand_tone(tone, job);
  job.missing = 0;
  const std::size_t heads = table.sources.size();
  for (std::size_t h = 0; h < heads; ++h) {
    if (pictures[h].planes[0].data == nullptr) {
      job.missing |= 1U << h;
      continue;
    }
    if (table.sources[h].low_size != 0) job.low[h] = pictures[table.sources[h].levels * heads + h];
    const int component = job.component[0].component;
    const PixelFormat format = table.sources[h].format;
    const PlaneGrid chroma = halved_chroma_grid(format, component, component_grid(format, component));
    job.luma_shift[h] = {static_cast<std::uint8_t>(chroma.step_x / 2), static_cast<std::uint8_t>(chroma.step_y / 2)};
    for (std::size_t level = 0; level < table.sources[h].levels; ++level) {
      const ImageView picture = halved_chroma(pictures[level * heads + h]);
      std::array<PlaneView, kMaxPlanes> views{};
      for (std::size_t c = 0; c < std::min<std::size_t>(kMaxPlanes, static_cast<std::size_t>(job.components)); ++c) {
        views[c] = picture.planes[static_cast<std::size_t>(job.component[c].component)];
      }
      job.planes[level][h] = patch_plane(views, static_cast<std::size_t>(job.components), picture.format);
      job.luma[level][h] = picture.planes[0];
    }
  }
}

}  // namespace nodal::blend
