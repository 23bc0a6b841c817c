#include "stitch/table/validate.h"

#include <array>
#include <string>

namespace nodal::table {
namespace {

using blend::BlendTable;
using blend::GridTable;
using blend::Tap;

tl::unexpected<Error> invalid(const std::string& what) {
  return fail(Errc::kTableInvalid, "blend table: " + what + "; compile it again from the calibration");
}

ImageView shape_of(PixelFormat format, int width, int height) {
  return packed_image(format, width, height, static_cast<const std::uint8_t*>(nullptr));
}

bool is_yuv(PixelFormat format) {
  return format == PixelFormat::kI420 || format == PixelFormat::kNv12 || format == PixelFormat::kYuyv ||
         format == PixelFormat::kUyvy;
}

Status check_shape(const BlendTable& table) {
  if (table.format != PixelFormat::kGrey8 && table.format != PixelFormat::kRgb24 &&
      table.format != PixelFormat::kI420) {
    return invalid("raymap format " + std::string(pixel_format_name(table.format)) + " is none it can have");
  }
  if (table.width < 1 || table.height < 1 || table.width > 65535 || table.height > 65535) {
    return invalid("raymap of " + std::to_string(table.width) + " x " + std::to_string(table.height));
  }
  if (table.sources.empty() || table.sources.size() > kMaxHeads) {
    return invalid(std::to_string(table.sources.size()) + " heads, not 1 to " + std::to_string(kMaxHeads));
  }
  for (std::size_t h = 0; h < table.sources.size(); ++h) {
    const BlendTable::Source& source = table.sources[h];
    const std::string head = "head " + std::to_string(h) + ": ";
    const bool fits = table.format == PixelFormat::kI420 ? is_yuv(source.format) : source.format == table.format;
    if (!fits) return invalid(head + "format does not fit the raymap's");
    if (source.width < 4 || source.height < 4 || source.width > 65535 || source.height > 65535) {
      return invalid(head + std::to_string(source.width) + " x " + std::to_string(source.height) + " px");
    }
    for (const std::uint16_t gain : source.gain) {
      if (gain < 1 || gain > blend::kMaxGain) return invalid(head + "gain " + std::to_string(gain));
    }
    if (source.sharpen > blend::kMaxSharpen) return invalid(head + "sharpening " + std::to_string(source.sharpen));
  }
  return {};
}

/// Components that share a grid must be those that share it in the format: every plane's samples are written.
Status check_components(const BlendTable& table) {
  const bool chroma = table.format == PixelFormat::kI420;
  if (table.grids.size() != (chroma ? 2U : 1U)) return invalid(std::to_string(table.grids.size()) + " grids");
  const ImageView raymap = shape_of(table.format, table.width, table.height);
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(table.format)); ++c) {
    const blend::ComponentRule& rule = table.components[c];
    const std::size_t expected = chroma && c > 0 ? 1 : 0;
    if (rule.grid != expected || rule.gain_row > 2) return invalid("rule of component " + std::to_string(c));
    const GridTable& grid = table.grids[expected];
    const int step = expected == 1 ? 2 : 1;
    if (grid.width != raymap.planes[c].width || grid.height != raymap.planes[c].height || grid.row_step != step) {
      return invalid("grid " + std::to_string(expected) + " does not have its component's size");
    }
  }
  return {};
}

/// Nothing, or what is wrong with a tap.
const char* fault_of(const Tap& tap, const std::array<PlaneView, kMaxHeads>& planes, std::size_t heads) {
  if (tap.head >= heads) return "names a head that is not there";
  const PlaneView& plane = planes[tap.head];
  if (tap.x + 1 >= plane.width || tap.y + 1 >= plane.height) return "reads outside its head's picture";
  if (tap.fraction_x >> blend::kFractionBits != 0 || tap.fraction_y >> blend::kFractionBits != 0) {
    return "has a fraction of one or more";
  }
  if (tap.weight < 1 || tap.weight > 1 << blend::kWeightBits) return "has a weight of nothing or more than one";
  if (tap.gain < 1 || tap.gain > blend::kMaxGain) return "has a gain out of range";
  if (tap.reserved != 0) return "has its reserved byte set";
  return nullptr;
}

Status check_taps(const BlendTable& table, std::size_t g) {
  const GridTable& grid = table.grids[g];
  const std::string where = "grid " + std::to_string(g);
  const auto samples = static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height);
  if (grid.first.size() != samples + 1) return invalid(where + ": first[] does not have one entry a sample and one");
  if (grid.first.front() != 0) return invalid(where + ": first[] does not begin at 0");
  if (grid.first.back() != grid.taps.size()) return invalid(where + ": first[] does not end at the last tap");
  std::array<PlaneView, kMaxHeads> planes;
  for (std::size_t h = 0; h < table.sources.size(); ++h) {
    planes[h] = shape_of(table.sources[h].format, table.sources[h].width, table.sources[h].height).planes[g];
  }
  for (std::size_t s = 0; s < samples; ++s) {
    const auto at = [&] {
      return where + ", sample (" + std::to_string(s % static_cast<std::size_t>(grid.width)) + ", " +
             std::to_string(s / static_cast<std::size_t>(grid.width)) + ")";
    };
    const std::uint32_t begin = grid.first[s];
    const std::uint32_t end = grid.first[s + 1];
    if (end < begin || end > grid.taps.size()) return invalid(at() + ": first[] falls or runs past the taps");
    if (begin == end) continue;
    std::uint64_t sum = 0;
    for (std::uint32_t t = begin; t < end; ++t) {
      if (const char* fault = fault_of(grid.taps[t], planes, table.sources.size())) {
        return invalid(at() + ", tap " + std::to_string(t - begin) + ": " + fault);
      }
      sum += grid.taps[t].weight;
    }
    if (sum != 1U << blend::kWeightBits) {
      return invalid(at() + ": weights sum to " + std::to_string(sum) + ", not " +
                     std::to_string(1 << blend::kWeightBits));
    }
  }
  return {};
}

}  // namespace

Status validate_blend_table(const BlendTable& table) {
  if (Status shape = check_shape(table); !shape) return shape;
  if (Status components = check_components(table); !components) return components;
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    if (Status taps = check_taps(table, g); !taps) return taps;
  }
  return {};
}

}  // namespace nodal::table
