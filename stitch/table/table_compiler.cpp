#include "stitch/table/table_compiler.h"

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/quantize.h"
#include "stitch/table/ray_sampler.h"
#include "stitch/table/validate.h"

namespace nodal::table {
namespace {

/// Y U V are full range: no light is Y 0, and U and V are about 128.
std::array<blend::ComponentRule, kMaxPlanes> component_rules(PixelFormat format) {
  if (format == PixelFormat::kI420) return {{{0, 0, 0}, {1, 128, 0}, {1, 128, 0}}};
  return {{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}};
}

struct Row {
  std::vector<std::uint32_t> ends;  ///< taps up to and with each sample of the row
  std::vector<blend::Tap> taps;
};

/// Makes one grid of its rows. They are given back at once: the rig has no room for the table twice.
Result<blend::GridTable> join(const RaySampler::Grid& shape, std::span<Row> rows) {
  std::size_t taps = 0;
  for (const Row& row : rows) taps += row.taps.size();
  if (taps > std::numeric_limits<std::uint32_t>::max()) {
    return fail(Errc::kTooLarge, "the blend table would have " + std::to_string(taps) +
                                     " taps, more than it can number; ask for a smaller raymap");
  }
  blend::GridTable table{shape.width, shape.height, shape.on_raymap.step_y, {}, {}};
  table.taps.reserve(taps);
  table.first.reserve(static_cast<std::size_t>(shape.width) * static_cast<std::size_t>(shape.height) + 1);
  table.first.push_back(0);
  for (Row& row : rows) {
    const auto base = static_cast<std::uint32_t>(table.taps.size());
    for (const std::uint32_t end : row.ends) table.first.push_back(base + end);
    table.taps.insert(table.taps.end(), row.taps.begin(), row.taps.end());
    row = Row{};
  }
  return table;
}

}  // namespace

struct TableCompiler::Work {
  std::unique_ptr<geometry::RaymapLayout> own_layout;  ///< when make() was given a name
  RaySampler sampler;
  std::vector<Row> rows;
};

TableCompiler::TableCompiler(std::unique_ptr<Work> work) : work_(std::move(work)) {
  std::size_t rows = 0;
  for (const RaySampler::Grid& grid : work_->sampler.grids()) rows += static_cast<std::size_t>(grid.height);
  work_->rows.resize(rows);
}
TableCompiler::TableCompiler(TableCompiler&&) noexcept = default;
TableCompiler& TableCompiler::operator=(TableCompiler&&) noexcept = default;
TableCompiler::~TableCompiler() = default;

Result<TableCompiler> TableCompiler::make(const Calibration& calibration, const RaymapSpec& raymap,
                                          std::span<const PixelFormat> head_formats, const TableOptions& options) {
  Result<std::unique_ptr<geometry::RaymapLayout>> layout =
      geometry::make_layout(raymap.layout, raymap.width, raymap.height);
  if (!layout) return fail(layout.error());
  Result<TableCompiler> compiler = make(calibration, **layout, raymap.format, head_formats, options);
  if (compiler) compiler->work_->own_layout = std::move(*layout);
  return compiler;
}

Result<TableCompiler> TableCompiler::make(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                          PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                          const TableOptions& options) {
  Result<RaySampler> sampler = RaySampler::make(calibration, layout, raymap_format, head_formats, options);
  if (!sampler) return fail(sampler.error());
  return TableCompiler(std::make_unique<Work>(Work{nullptr, std::move(*sampler), {}}));
}

int TableCompiler::row_count() const { return static_cast<int>(work_->rows.size()); }

void TableCompiler::compile_rows(int begin, int end) {
  const RaySampler& sampler = work_->sampler;
  RowSampler sampled(sampler);
  std::size_t grid = 0;
  int grid_begin = 0;
  for (int r = begin; r < end; ++r) {
    while (r >= grid_begin + sampler.grids()[grid].height) grid_begin += sampler.grids()[grid++].height;
    sampled.sample(static_cast<int>(grid), r - grid_begin);
    Row& row = work_->rows[static_cast<std::size_t>(r)];
    row = Row{};
    for (int x = 0; x < sampled.width(); ++x) {
      append_taps(sampled.at(x), sampler, static_cast<int>(grid), row.taps);
      row.ends.push_back(static_cast<std::uint32_t>(row.taps.size()));
    }
    row.taps.shrink_to_fit();
  }
}

Result<blend::BlendTable> TableCompiler::finish() && {
  const RaySampler& sampler = work_->sampler;
  blend::BlendTable table;
  table.format = sampler.raymap_format();
  table.width = sampler.layout().width();
  table.height = sampler.layout().height();
  table.components = component_rules(table.format);
  for (std::size_t h = 0; h < sampler.heads().size(); ++h) {
    const geometry::Head& head = sampler.heads()[h];
    blend::BlendTable::Source source{sampler.head_formats()[h], head.width(), head.height()};
    for (std::size_t k = 0; k < 3; ++k) source.gain[k] = quantize_gain(sampler.optics()[h].gain[k]);
    source.sharpen = static_cast<std::uint8_t>(std::clamp(sampler.options().sharpen, 0, blend::kMaxSharpen));
    table.sources.push_back(source);
  }
  std::span<Row> rows(work_->rows);
  for (const RaySampler::Grid& shape : sampler.grids()) {
    const auto height = static_cast<std::size_t>(shape.height);
    Result<blend::GridTable> grid = join(shape, rows.first(height));
    if (!grid) return fail(grid.error());
    rows = rows.subspan(height);
    table.grids.push_back(std::move(*grid));
  }
  if (table.grids[0].taps.empty()) {
    return fail(Errc::kNoCoverage, "no head sees any ray of the " + std::string(sampler.layout().name()) +
                                       " raymap; check the heads' regions and rotations");
  }
  if (Status proven = validate_blend_table(table); !proven) return fail(proven.error());
  return table;
}

Result<blend::BlendTable> compile_blend_table(const Calibration& calibration, const RaymapSpec& raymap,
                                              std::span<const PixelFormat> head_formats,
                                              const TableOptions& options) {
  Result<TableCompiler> compiler = TableCompiler::make(calibration, raymap, head_formats, options);
  if (!compiler) return fail(compiler.error());
  compiler->compile_rows(0, compiler->row_count());
  return std::move(*compiler).finish();
}

Result<blend::BlendTable> compile_blend_table(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                              PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                              const TableOptions& options) {
  Result<TableCompiler> compiler = TableCompiler::make(calibration, layout, raymap_format, head_formats, options);
  if (!compiler) return fail(compiler.error());
  compiler->compile_rows(0, compiler->row_count());
  return std::move(*compiler).finish();
}

}  // namespace nodal::table
