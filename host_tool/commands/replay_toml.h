// A rig.toml whose heads replay pictures, for commands that make a calibration from pictures.
#pragma once

#include <string>
#include <vector>

#include "host_tool/input/rig_pictures.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// The picture of each head in the first set as a file that nodald replays whole. If a file was split, names for the
/// parts, beside `toml`: rig.left.png; they are written by write_parts().
/// Errors: kUnsupported for pictures that are no files; kExists for a part's name.
Result<std::vector<std::string>> replayed_files(const RigPictures& rig, const std::string& toml);

/// Writes the parts of a split file, whose pictures are decoded; does nothing if no file was split.
Status write_parts(const RigPictures& rig, const std::vector<std::string>& replayed);

/// `pictures`: the file of each head, in the calibration's order. Those below the folder of `file`, which is where the
/// text will be written, are named relative to it. `source`: where the calibration is from, for the first comment.
/// Errors: those of nodald's own parser, which reads the text back: a name or a picture that a rig.toml cannot have.
Result<std::string> replay_rig_toml(const Calibration& calibration, const std::vector<std::string>& pictures,
                                    const std::string& source, const std::string& file);

}  // namespace nodal::host
