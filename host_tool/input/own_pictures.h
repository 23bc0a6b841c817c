// A rig from nothing but its pictures: autocalibration, then registration as far as the pictures allow.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "host_tool/input/rig_pictures.h"
#include "host_tool/input/up_choice.h"
#include "protocol/base/result.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// What heads are called whose files these are: the last parts of the paths, of files without their endings, if all of
/// them can be heads' names; else cam0, cam1 and so on.
std::vector<std::string> head_names(const std::vector<std::string>& paths);

/// Whether it is a folder, a film, or a file that starts like a picture, also one of a format that is not read, or is
/// called like one.
bool is_picture(const std::string& path);

/// The pictures among the arguments, of a rig without a calibration. The folder of a take: its middle set. Films:
/// the middle set, a head for each film. Two or more
/// folders are a folder for each head, with a sequence: the n-th pictures, sorted by name, are a set, and heads are
/// called after the folders. Otherwise all pictures are one set (a folder stands for the pictures in it, sorted by
/// name; copies are left out with a note), and heads are called after the files. Files with several pictures
/// (split_of()) are a set each. Where names cannot be heads' names, they are cam0, cam1 and so on.
/// Errors: kBadValue for an argument that is neither, for two that are the same picture, or for folders with different
///   numbers of pictures, with what to do; kNotFound for a folder without pictures.
Result<RigPictures> own_pictures(const std::vector<std::string>& arguments, const SplitChoice& choice = {});

/// Called on the caller's thread with the share of the work that is done, and what is being done.
using OwnProgress = std::function<void(double done, const std::string& what)>;

/// Finds the lens and the rotations of the heads by matched points of the middle set, whose pictures stay decoded, and
/// sets the calibration, `match` and notes. Heads that are not placed are left out of all sets.
/// Returns the places that the other heads had in each set.
/// Errors: those of reading pictures, of autocalibrate(), with what to do, and of turn_up().
Result<std::vector<std::size_t>> calibrate_by_pictures(RigPictures& rig, const UpChoice& up,
                                                       const OwnProgress& progress);

/// Registers the pictures of the matched set as far as they determine it: the whole lens, else the focal lengths, else
/// rotations, else gains and fall-off only; of a lens that points do not determine over most of its radius, rotations
/// at most; at last in red, green and blue. A result counts only if it places every head, lets the pictures differ less
/// than without it, and agrees with the points as well as the calibration found by them: near things, which heads see
/// in different directions, draw pictures away from them.
Result<registration::Report> refined(const RigPictures& rig, const OwnProgress& progress);

/// The same; where the pictures' light cannot be matched, the calibration that their points gave, and a warning that
/// says so. Then the report has no pairs.
registration::Report registered_alone(const RigPictures& rig, const OwnProgress& progress);

}  // namespace nodal::host
