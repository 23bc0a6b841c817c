#include "stitch/registration/check_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "protocol/base/angles.h"

namespace nodal::registration {
namespace {

constexpr float kBlack = 6;  // levels: a picture without a brighter pixel is black
constexpr double kMinAgreement = 0.4;

std::string quoted(const std::string& name) { return "'" + name + "'"; }

std::string number(const char* form, double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), form, value);
  return std::string(text.data());
}

std::string displaced(double size_px) {
  return "where heads overlap, their pictures are displaced against each other by about " +
         number(size_px < 1 ? "%.2f" : "%.1f", size_px) + " px (rms), and no rotation removes that";
}

std::string what_is_estimated(Free estimated) {
  return estimated == Free::kFocals ? "of the lenses only the focal lengths are estimated"
                                    : "the lenses are the calibration's, and only rotations are estimated";
}

}  // namespace

Status check_frames(const Calibration& prior, const std::vector<FrameSet>& frame_sets) {
  if (prior.heads.size() < 2) {
    return fail(Errc::kBadValue, "the calibration has one head; registration needs two or more that overlap");
  }
  if (frame_sets.empty())
    return fail(Errc::kBadValue, "no frames; give one picture per head, in the calibration's order");
  for (const FrameSet& frames : frame_sets) {
    if (frames.size() != prior.heads.size()) {
      return fail(Errc::kBadValue,
                  fmt::format("{} pictures for {} heads; give one picture of each head, in the calibration's order",
                              frames.size(), prior.heads.size()));
    }
    for (std::size_t h = 0; h < frames.size(); ++h) {
      const HeadCalibration& head = prior.heads[h];
      if (frames[h].format == PixelFormat::kMjpeg) {
        return fail(Errc::kUnsupported, "head " + quoted(head.name) + ": decode MJPEG frames first");
      }
      if (frames[h].width != head.width || frames[h].height != head.height) {
        return fail(
            Errc::kBadValue,
            fmt::format(
                "head {}: the picture is {}x{}, the calibration says {}x{}; take pictures of the calibrated size",
                quoted(head.name), frames[h].width, frames[h].height, head.width, head.height));
      }
    }
  }
  return {};
}

Status check_light(const Calibration& prior, const std::vector<HeadPyramid>& pyramids) {
  for (std::size_t h = 0; h < pyramids.size(); ++h) {
    // A head needs one picture that is not black; the others may be.
    float brightest = 0;
    for (const Plane& plane : pyramids[h].levels.back())
      brightest = std::max(brightest, std::ranges::max(plane.values));
    if (brightest < kBlack) {
      return fail(Errc::kNotDetermined, "head " + quoted(prior.heads[h].name) +
                                            " is black; take its lens cap off, raise its exposure, or leave it out");
    }
    for (std::size_t other = 0; other < h; ++other) {
      const auto same = [](const Plane& a, const Plane& b) { return a.values == b.values; };
      if (std::ranges::equal(pyramids[h].levels.front(), pyramids[other].levels.front(), same)) {
        return fail(Errc::kHeadMismatch, "heads " + quoted(prior.heads[other].name) + " and " +
                                             quoted(prior.heads[h].name) +
                                             " have the same picture; give each head its own");
      }
    }
  }
  return {};
}

Status check_enough_placed(const Calibration& prior, const std::vector<std::string>& why_not) {
  const auto placed = std::ranges::count_if(why_not, [](const std::string& why) { return why.empty(); });
  if (placed >= 2) return {};
  std::string first;
  for (std::size_t h = 0; h < why_not.size() && first.empty(); ++h) {
    if (!why_not[h].empty()) first = "head " + quoted(prior.heads[h].name) + ": " + why_not[h];
  }
  return fail(Errc::kNoCoverage, "no two heads can be placed against each other (" + first +
                                     "); film a scene with detail all around, or check the prior's fields of view");
}

std::vector<std::size_t> disagreeing(const Detail& detail, const std::vector<std::string>& why_not) {
  std::vector<std::size_t> wrong;
  for (std::size_t h = 0; h < why_not.size(); ++h) {
    if (why_not[h].empty() && detail.heads[h].agreement < kMinAgreement) wrong.push_back(h);
  }
  return wrong;
}

Status check_agreement(const Calibration& prior, const std::vector<std::size_t>& wrong, std::size_t placed) {
  if (wrong.empty()) return {};
  std::string names;
  for (const std::size_t h : wrong) names += (names.empty() ? "'" : ", '") + prior.heads[h].name + "'";
  if (2 * wrong.size() > placed) {
    return fail(Errc::kHeadMismatch,
                (wrong.size() == placed ? std::string("the heads' pictures") : "most heads' pictures (" + names + ")") +
                    " have nothing in common where they should overlap; check that they are of one scene and in the "
                    "calibration's order and that the lens model is right, or start from point pairs");
  }
  return fail(Errc::kHeadMismatch,
              std::string(wrong.size() == 1 ? "head " : "heads ") + names +
                  " and their neighbours see different things where they should overlap; check that each picture is "
                  "of its own head and all were taken at the same moment, or start from point pairs");
}

std::string lens_misfit(bool focals, double promised, double size_px) {
  const int percent = static_cast<int>(std::lround(100 * promised));
  return fmt::format(
      "the lenses may not fit the pictures: {}, and other lenses would remove {} % of the remaining differences; this "
      "falsifies the rotations; {}",
      displaced(size_px), percent,
      focals ? "estimate the focal lengths, too" : "estimate the whole lenses, too, or calibrate them");
}

std::string near_things(double nearness, double size_px, const Calibration& prior, bool thin) {
  if (nearness <= 0) {
    return displaced(size_px) + "; heads may see near things from different positions, " +
           (thin ? "their lenses may not be quite the calibration's, which so thin overlaps do not tell, " : "") +
           "or things may have moved between the pictures: film a still scene that is farther away, or " +
           (farthest_position(prior) > 0 ? "run again with --free distance"
                                         : "add `position` to the heads (CALIBRATION.md) and run again with --free "
                                           "distance");
  }
  return displaced(size_px) + ", and the pictures agree better if they meet at about " + number("%.1f", 1 / nearness) +
         " m than at " + (prior.distance > 0 ? "the calibration's distance" : "infinity") +
         "; near things double at the seams: run again with --free distance";
}

std::string fewer_lens_parameters(Free asked, Free estimated, const std::string& error, double size_px) {
  const std::string did = what_is_estimated(estimated);
  const std::string could_not =
      error.empty() ? "near things may bend the lenses: with whole lenses estimated, " + displaced(size_px)
                    : std::string("there is no result with ") +
                          (asked == Free::kLens ? "whole lenses" : "focal lengths") + " estimated (" + error + ")";
  return did + ", because " + could_not + "; to estimate them, film a scene with detail all around and far away";
}

std::string where_known(const KnownLens& known) {
  const std::string where = number("%.0f", known.from_deg) + " to " + number("%.0f", known.to_deg) +
                            " degrees from their axes (" + number("%.0f", known.from_px) + " to " +
                            number("%.0f", known.to_px) + " px in the first head's picture); elsewhere ";
  if (known.unsure <= 0) return where + "they are as they were before this registration, but for their scale";
  return where + "they follow their kind of lens, and the distance from the axis may be wrong by about " +
         number("%.0f", std::ceil(100 * known.unsure)) + " %";
}

std::string thin_overlaps(const Options& asked, Free estimated, const SeenRadii& seen, const KnownLens& known) {
  const std::string why = "heads show the same things only " + number("%.0f", seen.from_deg) + " to " +
                          number("%.0f", seen.to_deg) + " degrees from their lenses' axes";
  return (asked.free == estimated ? why : what_is_estimated(estimated) + ", because " + why) +
         (estimated == Free::kRotations ? "" : "; focal lengths change by one factor for all heads") +
         ". The lenses are known " + where_known(known) + ". Heads that overlap more determine them, or " +
         (asked.lens_kind_assumed ? "the kind of lens if it is known, or " : "") + "`nodal calibrate lens`";
}

std::string held_light(const std::string& head) {
  return "head " + quoted(head) +
         ": the pictures' light asks for a stronger fall-off or gain than a calibration may have; it is held at the "
         "limit";
}

std::string weak_head(const HeadReport& head) {
  std::string message =
      "head " + quoted(head.name) + " shows much less detail than the others (out of focus, fog, an empty sky)";
  if (head.sigma_deg > 0) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "; its rotation is sure only to %.2g degrees", head.sigma_deg);
    message += text.data();
  }
  return message;
}

std::string disagreement(bool little_detail, double agreement) {
  const std::string size = " (their detail correlates by " + number("%.2f", agreement) + ", and equal detail by 1)";
  return little_detail ? "it shows much less detail than its neighbours and does not agree with them" + size +
                             "; check its focus, and "
                             "that its front is clean"
                       : "it and its neighbours see different things where they should overlap" + size +
                             "; check that the picture is "
                             "its own and was taken at the same moment, or start from point pairs";
}

std::string wrong_lenses(bool focals) {
  return std::string("the calibration's lenses do not fit these pictures, so only some heads can be placed; ") +
         (focals ? "estimate the focal lengths, too"
                 : "check the lens model and the field of view, and estimate the lenses, too");
}

std::string wrong_focals(double rms_percent, double mean_percent, double held, double sought) {
  const bool one_way = std::abs(mean_percent) > 0.7 * rms_percent;
  return "the calibration's focal lengths are about " + number("%.1f", rms_percent) + " % " +
         (one_way ? mean_percent > 0 ? "too short" : "too long" : "off") +
         ", and rotations alone cannot compensate for that (the heads differ by " + number("%.1f", held) +
         " levels, and by " + number("%.1f", sought) +
         " with estimated focal lengths); estimate the focal lengths, too";
}

std::string doubtful_seams(const Calibration& prior, const std::vector<PairReport>& pairs, bool explained) {
  constexpr std::size_t kMaxNamed = 6;
  std::string names;
  for (std::size_t k = 0; k < std::min(pairs.size(), kMaxNamed); ++k) {
    names += (k > 0 ? ", " : "") + quoted(prior.heads[static_cast<std::size_t>(pairs[k].a)].name) + " and " +
             quoted(prior.heads[static_cast<std::size_t>(pairs[k].b)].name) + " (" +
             number("%.2f", pairs[k].agreement) + ")";
  }
  if (pairs.size() > kMaxNamed) names += fmt::format(" and {} more pairs", pairs.size() - kMaxNamed);
  return "heads " + names +
         " do not line up in fine detail (in brackets: its correlation, 1 for equal detail); look at their " +
         (pairs.size() == 1 ? "seam" : "seams") +
         (explained ? ""
                    : ": objects may be close to the rig, or, in a pattern that repeats (tiles, windows), a head may "
                      "be off by "
                      "one repetition: then give point pairs");
}

std::string things_repeat(const std::string& head, double turned_rad) {
  return "things repeat in the overlaps of head " + quoted(head) + " (tiles, windows, columns): turned by " +
         number("%.0f", turned_rad * kDegreesPerRadian) +
         " degrees, it would agree with its neighbours nearly as well, so its rotation may be wrong by that much; "
         "compare the sphere with the place, and if it is wrong, give point pairs";
}

std::string nothing_shared(const Calibration& prior) {
  return fmt::format("none of the {} heads shares rays with another; check fields of view and rotations of the prior",
                     prior.heads.size());
}

}  // namespace nodal::registration
