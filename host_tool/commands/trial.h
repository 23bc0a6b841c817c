// A calibration on trial: the rig runs it, the host judges it; without an answer the rig goes back by itself.
#pragma once

#include "host_tool/commands/command.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"

namespace nodal::host {

struct TrialVerdict {
  double before = 0;  ///< objective of what was in force, on frames taken during the trial; levels squared
  double after = 0;   ///< of what was tried, on the same frames
  bool kept = false;
};

/// Uploads `tried` on trial, pulls `sets` frame sets that the rig blended by it, and compares what it and the calibration
/// that was in force leave of the differences between heads: on the same frames, which neither was made from. Lower is
/// kept; else the rig goes back, and so it does by itself `limit` after the swap if this program, its link or the rig's
/// power fails.
///
/// Errors: kUnsupported for a rig without trials; the upload's; pull_frame_sets()'s; the judgement's. After each of them
///   the rig is told to go back, and goes back by itself when that cannot be told.
/// `document` is `tried` as its file has it and `signature` that file's; without them its own form goes, unsigned.
Result<TrialVerdict> try_out(Context& context, const Calibration& tried, int sets, Duration limit,
                             std::string document = "", const std::string& signature = "");

/// One line and a document; the shell is told when it was not kept.
void tell_verdict(Context& context, const TrialVerdict& verdict);

inline constexpr Duration kTrialLimit = Duration::seconds(60);

}  // namespace nodal::host
