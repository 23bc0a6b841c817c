// The tables a calibration runs by, compiled in slices: one, or one a field.
#pragma once

#include <optional>
#include <vector>

#include "firmware/config/config.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/blend_table.h"
#include "stitch/table/table_compiler.h"

namespace nodal::firmware {

/// Tables are made one after the other, so that only one is there twice while its rows are joined.
///
/// Threading: thread-bound.
/// Ownership: keeps what it needs of the calibration.
/// Errors: those of table::TableCompiler, from make() or finish().
class TableJob {
 public:
  /// For heads that deliver `formats`, in the calibration's order.
  static Result<TableJob> make(const Calibration& calibration, const RigConfig& config,
                               std::vector<PixelFormat> formats);

  bool done() const { return !compiler_; }
  int percent() const;
  /// The next rows of tiles, so many at most. Not when it is done.
  void compile_some(int rows);
  /// In the order in which their fields are exposed. When it is done.
  Result<std::vector<blend::BlendTable>> finish() &&;

 private:
  TableJob() = default;
  Status next_table();

  Calibration calibration_;
  std::vector<PixelFormat> formats_;
  table::RaymapSpec spec_;
  table::TableOptions options_;
  std::vector<std::optional<FieldParity>> fields_;  ///< of every table
  std::optional<table::TableCompiler> compiler_;    ///< of the one under way
  int rows_done_ = 0;
  std::vector<blend::BlendTable> tables_;
  Status status_;
};

}  // namespace nodal::firmware
