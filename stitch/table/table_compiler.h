// Compiles a calibration and a layout, in double precision, to the fixed-point table that the board runs. This is the
// only header of stitch/table that firmware needs; its functions take no floating-point numbers.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/blend_table.h"
#include "stitch/table/compile_cost.h"
#include "stitch/table/options.h"

namespace nodal::geometry {
class RaymapLayout;
}

namespace nodal::table {

/// The raymap that is wanted.
struct RaymapSpec {
  std::string layout = "equirectangular";  ///< a name of stitch/geometry/raymap/layout.h
  int width = 2048;
  int height = 1024;
  PixelFormat format = PixelFormat::kI420;  ///< I420, NV12, RGB24, GREY, RGB48 or GREY16
};

/// Compiles a table on the calling thread and validates it. heads[i] of the calibration delivers head_formats[i] in the
/// calibration's size. RGB24 heads make RGB24 and RGB48 raymaps, GREY heads make GREY and GREY16, and any mixture of
/// I420, NV12, YUYV and UYVY heads makes I420 and NV12.
/// Errors: kHeadMismatch if the numbers of formats and heads differ, kUnsupported for other combinations of formats
/// (names the head) and for unknown layouts, kNoCoverage if no head sees any ray of the layout, kTooLarge, and the
/// errors of the calibration and the layout.
Result<blend::BlendTable> compile_blend_table(const Calibration& calibration, const RaymapSpec& raymap,
                                              std::span<const PixelFormat> head_formats,
                                              const TableOptions& options = {});
/// The same for a given layout.
Result<blend::BlendTable> compile_blend_table(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                              PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                              const TableOptions& options = {});

/// The same in pieces, for callers that own threads: make, compile_rows over a partition of 0 .. row_count(),
/// finish. Any partition gives the same table.
///
/// Threading: compile_rows may run on any number of threads at once, on disjoint rows; all else on one.
/// Ownership: copies its arguments, except a layout that is passed by reference, which must live until finish().
class TableCompiler {
 public:
  /// Errors: those of compile_blend_table, except kNoCoverage and kTooLarge.
  static Result<TableCompiler> make(const Calibration& calibration, const RaymapSpec& raymap,
                                    std::span<const PixelFormat> head_formats, const TableOptions& options = {});
  static Result<TableCompiler> make(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                    PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                    const TableOptions& options = {});
  TableCompiler(TableCompiler&&) noexcept;
  TableCompiler& operator=(TableCompiler&&) noexcept;
  ~TableCompiler();

  /// The work of all rows.
  CompileCost cost() const;
  /// The rows of tiles of all grids together.
  int row_count() const;
  void compile_rows(int begin, int end);
  /// Joins the rows, all of which must have been compiled, and validates the table. Errors: kNoCoverage, kTooLarge.
  Result<blend::BlendTable> finish() &&;

 private:
  struct Work;
  explicit TableCompiler(std::unique_ptr<Work> work);
  std::unique_ptr<Work> work_;
};

}  // namespace nodal::table
