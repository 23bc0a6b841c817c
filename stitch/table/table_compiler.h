// THE BRIDGE: a calibration and a layout in double precision become the fixed-point table the board runs. This
// header is all that firmware needs; it shows no double precision.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/blend_table.h"
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

/// Compiles a table on the calling thread and proves it: heads[i] of the calibration delivers head_formats[i] in
/// the calibration's size. RGB24 heads make RGB24 and RGB48 raymaps, GREY ones GREY and GREY16, and I420, NV12, YUYV
/// and UYVY in any mixture I420 and NV12.
/// Errors: kHeadMismatch when there is not one format a head, kUnsupported for any other pair of formats (names
/// the head) and for unknown layouts, kNoCoverage when no head sees any of the layout, kTooLarge, and the
/// calibration's and the layout's own.
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
  /// Errors: those of compile_blend_table that do not need the rays.
  static Result<TableCompiler> make(const Calibration& calibration, const RaymapSpec& raymap,
                                    std::span<const PixelFormat> head_formats, const TableOptions& options = {});
  static Result<TableCompiler> make(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                    PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                    const TableOptions& options = {});
  TableCompiler(TableCompiler&&) noexcept;
  TableCompiler& operator=(TableCompiler&&) noexcept;
  ~TableCompiler();

  /// The rows of tiles of every grid, one after the other.
  int row_count() const;
  void compile_rows(int begin, int end);
  /// Joins the rows, all of which must have been compiled, and proves the table. Errors: kNoCoverage, kTooLarge.
  Result<blend::BlendTable> finish() &&;

 private:
  struct Work;
  explicit TableCompiler(std::unique_ptr<Work> work);
  std::unique_ptr<Work> work_;
};

}  // namespace nodal::table
