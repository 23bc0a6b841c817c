// Detects frames that would give a plausible but wrong result. Each error is one sentence that says what to try.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/registration/observability.h"
#include "stitch/registration/pyramid.h"
#include "stitch/registration/registration.h"
#include "stitch/registration/seen_radii.h"

namespace nodal::registration {

/// Checks numbers and sizes of pictures. Errors: kBadValue, kUnsupported.
Status check_frames(const Calibration& prior, const std::vector<FrameSet>& frame_sets);

/// Errors: kNotDetermined if a head is black, kHeadMismatch if two heads have the same picture.
Status check_light(const Calibration& prior, const std::vector<HeadPyramid>& pyramids);

/// Errors: kNoCoverage if fewer than two heads are placed; `why_not` is empty for a placed head.
Status check_enough_placed(const Calibration& prior, const std::vector<std::string>& why_not);

/// The heads whose detail differs from their neighbours' in the overlaps.
std::vector<std::size_t> disagreeing(const Detail& detail, const std::vector<std::string>& why_not);
/// Errors: kHeadMismatch if `wrong` is not empty.
Status check_agreement(const Calibration& prior, const std::vector<std::size_t>& wrong, std::size_t placed);

/// Messages for lenses that do not fit the pictures. `focals`: only their focal lengths are wrong. `promised`: the
/// share of the differences that other lenses would remove. `size_px`: Certainty::parts_px.
std::string lens_misfit(bool focals, double promised, double size_px);
std::string wrong_lenses(bool focals);
/// `nearness`: 1 / the distance at which the pictures agree best, 1/m; 0: unknown. `size_px`: Certainty::parts_px.
/// `thin`: heads overlap so little that wrong lenses look the same.
std::string near_things(double nearness, double size_px, const Calibration& prior, bool thin);
/// Why fewer parameters of lenses are estimated than was asked for. `error`: that of what was asked for; empty if it
/// has a result, but near things affect it, by `size_px` (Certainty::parts_px).
std::string fewer_lens_parameters(Free asked, Free estimated, const std::string& error, double size_px);
/// Overlaps show only a thin range of angles from the lenses' axes: where lenses are known, and, if fewer parameters
/// are estimated than was asked for, that this is why.
std::string thin_overlaps(const Options& asked, Free estimated, const SeenRadii& seen, const KnownLens& known);
/// "87 to 93 degrees from their axes (...); elsewhere ...": after "the lenses are known".
std::string where_known(const KnownLens& known);
/// A placed head with little detail.
std::string weak_head(const HeadReport& head);
/// A head whose gains or fall-off came out beyond what a calibration may have (geometry::hold_light).
std::string held_light(const std::string& head);
/// Why a head is left out that agrees with no other. `agreement`: the correlation of its detail with the others'.
std::string disagreement(bool little_detail, double agreement);
/// The message for wrong focal lengths: their errors in percent (rms and mean), and by how many levels the heads differ
/// if they are held and if they are estimated.
std::string wrong_focals(double rms_percent, double mean_percent, double held, double sought);

/// The message for pairs of placed heads whose fine detail does not line up. `explained`: another message says why.
std::string doubtful_seams(const Calibration& prior, const std::vector<PairReport>& pairs, bool explained);

/// A head that would agree with its neighbours, too, if it were turned by `turned_rad`.
std::string things_repeat(const std::string& head, double turned_rad);

std::string nothing_shared(const Calibration& prior);

}  // namespace nodal::registration
