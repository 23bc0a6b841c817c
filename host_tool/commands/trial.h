// A calibration on trial: the rig uses it, the host evaluates it; without an answer the rig reverts by itself.
#pragma once

#include "host_tool/commands/command.h"
#include "host_tool/input/rig_trial.h"
#include "host_tool/rig/upload.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

struct TrialVerdict {
  TrialFigures figures;
  bool kept = false;
};

/// Tries `tried` out on the rig (RigTrial) with `sets` frame sets. If it has the lower objective it is kept, else the
/// rig reverts.
///
/// Errors: those of RigTrial. After each of them the rig is told to revert, and it reverts by itself if that message
///   does not arrive.
Result<TrialVerdict> try_out(Context& context, const Calibration& tried, int sets, const UploadTerms& terms,
                             std::string document = "");

/// Prints one line or a document; sets the exit code if the calibration was not kept.
void tell_verdict(Context& context, const TrialVerdict& verdict);

}  // namespace nodal::host
