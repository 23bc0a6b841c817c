#include "stitch/table/table_job.h"

#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/table_compiler.h"

namespace nodal::table {

struct TableJob::State {
  std::unique_ptr<geometry::RaymapLayout> layout;
  TableCompiler compiler;
};

TableJob::TableJob(std::unique_ptr<State> state) : state_(std::move(state)) {}
TableJob::~TableJob() = default;
TableJob::TableJob(TableJob&&) noexcept = default;
TableJob& TableJob::operator=(TableJob&&) noexcept = default;

Result<TableJob> TableJob::make(const Calibration& calibration, std::string_view layout, int width, int height,
                                PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                const TableOptions& options) {
  auto made = geometry::make_layout(layout, width, height);
  if (!made) return fail(made.error());
  auto compiler = TableCompiler::make(calibration, **made, raymap_format, head_formats, options);
  if (!compiler) return fail(compiler.error());
  return TableJob(std::make_unique<State>(State{std::move(*made), std::move(*compiler)}));
}

int TableJob::row_count() const { return state_->compiler.row_count(); }

void TableJob::compile_rows(int begin, int end) { state_->compiler.compile_rows(begin, end); }

Result<blend::BlendTable> TableJob::finish() && { return std::move(state_->compiler).finish(); }

}  // namespace nodal::table
