// Compiles the tables of a calibration in slices: one table for whole frames, or one per field.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/blend_table.h"
#include "stitch/table/table_compiler.h"

namespace nodal::sets {

/// Tables are compiled one after the other: joining a table's rows needs the memory twice, and so only for one table.
///
/// Threading: thread-bound.
/// Ownership: copies the calibration.
/// Errors: those of table::TableCompiler, from make() or finish().
class TableJob {
 public:
  /// For heads that deliver `formats`, in the calibration's order. The tables are for pictures of blended_format().
  /// `fields` of the heads decides which field's table is in front, if there are two.
  static Result<TableJob> make(const Calibration& calibration, const RaymapConfig& raymap, Fields fields,
                               std::vector<PixelFormat> formats);

  /// For one table that is compiled in another way than [raymap] can say.
  static TableJob of(table::TableCompiler compiler);

  /// Whether a rig's board may compile these tables. Before the first row. Errors: kTooLarge, naming the head that
  /// costs most.
  Status check_budget() const;
  bool done() const { return !compiler_; }
  int percent() const;
  /// Compiles at most `rows` further rows of tiles. Only while not done().
  void compile_some(int rows);
  /// Compiles at most `pieces` of kRowsAPiece rows with threads of the caller: share(pieces, work) calls work(i) for i
  /// in 0 .. pieces - 1, on any threads. Rows of one piece share some of the work.
  using Share = std::function<void(int pieces, const std::function<void(int)>& work)>;
  void compile_pieces(int pieces, const Share& share);
  static constexpr int kRowsAPiece = 8;
  /// What the heads deliver.
  const std::vector<PixelFormat>& delivered() const { return delivered_; }
  /// The tables, that of the field exposed first in front. Only when done().
  Result<std::vector<blend::BlendTable>> finish() &&;

 private:
  TableJob() = default;
  Status next_table();
  void rows_are_done(int until);

  Calibration calibration_;
  std::vector<PixelFormat> delivered_;
  std::vector<PixelFormat> formats_;  ///< as blended
  table::RaymapSpec spec_;
  table::TableOptions options_;
  std::vector<std::optional<FieldParity>> fields_;  ///< one per table; empty: whole frames
  std::optional<table::TableCompiler> compiler_;    ///< compiler of the current table
  int rows_done_ = 0;
  std::vector<blend::BlendTable> tables_;
  Status status_;
};

}  // namespace nodal::sets
