// A calibration on trial: the rig uses it, the host evaluates it; without an answer the rig reverts by itself.
#pragma once

#include "host_tool/commands/command.h"
#include "host_tool/rig/upload.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"

namespace nodal::host {

struct TrialVerdict {
  double before = 0;  ///< objective of the calibration in force, on frames taken during the trial; levels squared
  double after = 0;   ///< objective of the tried calibration, on the same frames
  bool kept = false;
};

/// Uploads `tried` on trial, pulls `sets` frame sets that the rig blended with it, and compares the differences between
/// heads that remain under it and under the calibration in force: on the same frames, from which neither was made. If
/// `tried` has the lower objective it is kept, else the rig reverts. If this program, its link or the rig's power fail,
/// the rig reverts by itself `terms.trial` after the swap, or after 40 frame periods, if these are longer. `document`
/// is the file of `tried`, which `terms.signature` is for; without them `tried` is serialized and sent unsigned.
///
/// Errors: kUnsupported for a rig without trials; those of upload(), of pull_frame_sets() and of the evaluation. After
///   each of them the rig is told to revert, and it reverts by itself if that message does not arrive.
Result<TrialVerdict> try_out(Context& context, const Calibration& tried, int sets, UploadTerms terms,
                             std::string document = "");

/// Prints one line or a document; sets the exit code if the calibration was not kept.
void tell_verdict(Context& context, const TrialVerdict& verdict);

inline constexpr Duration kTrialLimit = Duration::seconds(60);

}  // namespace nodal::host
