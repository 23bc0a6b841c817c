// A table's compilation in slices, for a caller that knows neither geometry nor double precision.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/blend_table.h"
#include "stitch/table/options.h"

namespace nodal::table {

/// TableCompiler with the layout by name.
///
/// Threading: compile_rows() may run on any number of threads at once, on disjoint rows; all else on one.
/// Ownership: owns everything it needs.
/// Errors: as compile_blend_table(), and make_layout()'s.
class TableJob {
 public:
  static Result<TableJob> make(const Calibration& calibration, std::string_view layout, int width, int height,
                               PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                               const TableOptions& options = {});
  ~TableJob();
  TableJob(TableJob&&) noexcept;
  TableJob& operator=(TableJob&&) noexcept;

  int row_count() const;
  void compile_rows(int begin, int end);
  /// Once every row is compiled: the proven table.
  Result<blend::BlendTable> finish() &&;

 private:
  struct State;
  explicit TableJob(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace nodal::table
