// A rig.toml whose heads replay pictures, for commands that make a calibration from pictures.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// `pictures`: the file of each head, in the calibration's order. Those below the folder of `file`, which is where the
/// text will be written, are named relative to it. `source`: where the calibration is from, for the first comment.
/// Errors: those of nodald's own parser, which reads the text back: a name or a picture that a rig.toml cannot have.
Result<std::string> replay_rig_toml(const Calibration& calibration, const std::vector<std::string>& pictures,
                                    const std::string& source, const std::string& file);

}  // namespace nodal::host
