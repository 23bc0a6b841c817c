#include "stitch/sets/table_job.h"

#include <algorithm>
#include <string>
#include <utility>

#include "protocol/base/try.h"

namespace nodal::sets {

Result<TableJob> TableJob::make(const Calibration& calibration, const RaymapConfig& raymap, Fields fields,
                                std::vector<PixelFormat> formats) {
  TableJob job;
  job.calibration_ = calibration;
  for (const PixelFormat delivered : formats) {
    // Of one that does not fit, the compiler's error says more.
    job.formats_.push_back(blended_format(delivered, raymap.format).value_or(delivered));
  }
  job.delivered_ = std::move(formats);
  job.spec_ = {raymap.layout, raymap.width, raymap.height, raymap.format};
  job.options_.transition = raymap.transition;
  job.options_.seam_width_deg = raymap.seam_width_deg;
  job.options_.feather = raymap.feather;
  job.fields_ = {std::nullopt};
  if (raymap.fields == FieldUse::kSeparate) {
    const FieldParity first = first_field(fields);
    job.fields_ = {first, other(first)};
  }
  NODAL_TRY(job.next_table());
  return job;
}

TableJob TableJob::of(table::TableCompiler compiler) {
  TableJob job;
  job.fields_ = {std::nullopt};
  job.compiler_.emplace(std::move(compiler));
  return job;
}

Status TableJob::next_table() {
  options_.field = fields_[tables_.size()];
  rows_done_ = 0;
  NODAL_TRY_ASSIGN(auto compiler, table::TableCompiler::make(calibration_, spec_, formats_, options_));
  compiler_.emplace(std::move(compiler));
  return {};
}

Status TableJob::check_budget() const {
  const auto pixels = static_cast<std::uint64_t>(spec_.width) * static_cast<std::uint64_t>(spec_.height);
  return table::check_compile_budget(compiler_->cost(), calibration_, pixels);
}

int TableJob::percent() const {
  if (done()) return 100;
  const int whole = 100 * static_cast<int>(tables_.size());
  return (whole + 100 * rows_done_ / compiler_->row_count()) / static_cast<int>(fields_.size());
}

void TableJob::compile_some(int rows) {
  NODAL_ASSERT(compiler_);
  const int until = std::min(compiler_->row_count(), rows_done_ + rows);
  compiler_->compile_rows(rows_done_, until);
  rows_are_done(until);
}

void TableJob::compile_pieces(int pieces, const Share& share) {
  NODAL_ASSERT(compiler_);
  const int until = std::min(compiler_->row_count(), rows_done_ + pieces * kRowsAPiece);
  share((until - rows_done_ + kRowsAPiece - 1) / kRowsAPiece, [&](int i) {
    const int first = rows_done_ + i * kRowsAPiece;
    compiler_->compile_rows(first, std::min(until, first + kRowsAPiece));
  });
  rows_are_done(until);
}

void TableJob::rows_are_done(int until) {
  rows_done_ = until;
  if (rows_done_ < compiler_->row_count()) return;
  auto table = std::move(*compiler_).finish();
  compiler_.reset();
  if (!table) {
    status_ = fail(table.error());
    return;
  }
  tables_.push_back(std::move(*table));
  if (tables_.size() < fields_.size()) status_ = next_table();
}

Result<std::vector<blend::BlendTable>> TableJob::finish() && {
  NODAL_ASSERT(done());
  if (!status_) return fail(status_.error());
  return std::move(tables_);
}

}  // namespace nodal::sets
