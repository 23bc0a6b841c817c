#include "host_tool/report/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "protocol/base/angles.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/try.h"
#include "stitch/media/image_file.h"
#include "stitch/offline/offline_blend.h"

namespace nodal::host {
namespace {

using offline::SeamCheck;
using offline::SeamPlace;
using offline::SeamVerdict;

constexpr int kMinHeight = 16, kMaxHeight = 8192;  ///< height of the sphere, px

std::size_t not_alike(const SeamCheck& seam) {
  return static_cast<std::size_t>(
      std::ranges::count_if(seam.places, [](const SeamPlace& place) { return !place.alike; }));
}

bool shows_different_things(const SeamCheck& seam) {
  return static_cast<double>(not_alike(seam)) > offline::kMaxWorseShare * static_cast<double>(seam.places.size());
}

std::string names_of(const SeamCheck& seam, const std::vector<std::string>& heads) {
  return fmt::format("'{}' and '{}'", heads[seam.a], heads[seam.b]);
}

/// Which of two seams a person would look at first.
bool worse(const SeamCheck& a, const SeamCheck& b) {
  const auto badness = [](const SeamCheck& seam) {
    return std::tuple(offline::verdict_of(seam), shows_different_things(seam), offline::usual_jump(seam),
                      offline::usual_bend(seam));
  };
  return badness(a) > badness(b);
}

}  // namespace

const char* name_of(SeamVerdict word) {
  if (word == SeamVerdict::kGood) return "good";
  return word == SeamVerdict::kUsable ? "usable" : "look";
}

std::string text_of(const geometry::Angles& at) {
  return fmt::format("yaw {:.0f}°, pitch {:.0f}°", at.theta * kDegreesPerRadian, -at.phi * kDegreesPerRadian);
}

std::string text_of(const SeamCheck& seam) {
  if (shows_different_things(seam)) return "the two pictures show different things there";
  if (offline::usual_jump(seam) > offline::kFinePx) {
    return fmt::format("lines jump by up to {:.0f} px", std::ceil(offline::usual_jump(seam)));
  }
  if (offline::usual_bend(seam) > offline::kFineBendPx) {
    return fmt::format("lines were bent by up to {:.0f} px so that they go on", std::ceil(offline::usual_bend(seam)));
  }
  if (std::abs(seam.step_levels) > offline::kFineStep) {
    return fmt::format("one picture is {:.0f} levels of 255 brighter", std::abs(seam.step_levels));
  }
  return "lines go on";
}

Verdict verdict_of(std::vector<SeamCheck> seams, const std::vector<std::string>& heads, std::size_t left_out) {
  std::ranges::stable_sort(seams, worse);
  Verdict verdict{offline::verdict_of(seams), {}, std::move(seams)};
  const auto as_bad = static_cast<std::size_t>(std::ranges::count_if(
      verdict.seams, [&](const SeamCheck& seam) { return offline::verdict_of(seam) == verdict.word; }));
  const std::string others = as_bad < 2    ? ""
                             : as_bad == 2 ? "; and at another seam"
                                           : fmt::format("; and at {} other seams", as_bad - 1);
  if (verdict.word == SeamVerdict::kGood) {
    verdict.sentence = "good: lines go on from picture to picture";
  } else {
    const SeamCheck& worst = verdict.seams.front();
    const SeamPlace* const place = offline::worst_place(worst);
    const bool look = verdict.word == SeamVerdict::kLook;
    verdict.sentence = fmt::format(
        "{} the seam between {}{}: {}{}", look ? "look at" : "usable; look closely at", names_of(worst, heads),
        place != nullptr ? fmt::format(" ({})", text_of(place->at)) : "", text_of(worst), others);
  }
  if (left_out == 0) return verdict;
  if (verdict.word == SeamVerdict::kGood) verdict.sentence = "usable: lines go on from picture to picture";
  verdict.word = std::max(verdict.word, SeamVerdict::kUsable);
  verdict.sentence += fmt::format(
      "; {} left out", left_out == 1 ? std::string("one picture is") : fmt::format("{} pictures are", left_out));
  return verdict;
}

Result<Verdict> verdict_on(const Calibration& calibration, std::span<const ImageView> frames) {
  NODAL_TRY_ASSIGN(const double resolution, offline::resolution_of(calibration));
  const auto height =
      static_cast<int>(std::clamp(std::round(resolution * kPi), double{kMinHeight}, double{kMaxHeight}));
  std::vector<DecodedImage> readable(frames.size());
  std::vector<ImageView> views(frames.begin(), frames.end());
  for (std::size_t h = 0; h < frames.size(); ++h) {
    const bool plain = frames[h].format == PixelFormat::kRgb24 || frames[h].planes[0].pixel_stride == 1;
    if (plain || frames[h].planes[0].data == nullptr) continue;
    readable[h] = media::convert_image(frames[h], PixelFormat::kGrey8);
    views[h] = readable[h].view();
  }
  NODAL_TRY_ASSIGN(auto seams, offline::check_seams(calibration, views, {2 * height, height}, 0));
  std::vector<std::string> heads;
  for (const HeadCalibration& head : calibration.heads) heads.push_back(head.name);
  return verdict_of(std::move(seams), heads, 0);
}

Json to_json(const Verdict& verdict, const std::vector<std::string>& heads) {
  Json seams = Json::array();
  for (const SeamCheck& seam : verdict.seams) {
    Json each{{"heads", {heads[seam.a], heads[seam.b]}},  {"verdict", name_of(offline::verdict_of(seam))},
              {"jump_px", offline::usual_jump(seam)},     {"bent_px", offline::usual_bend(seam)},
              {"step_levels", seam.step_levels},          {"places", seam.looked_at},
              {"places_with_detail", seam.places.size()}, {"places_that_differ", not_alike(seam)}};
    if (const SeamPlace* const worst = offline::worst_place(seam)) {
      each["worst"] = {{"yaw_deg", worst->at.theta * kDegreesPerRadian},
                       {"pitch_deg", -worst->at.phi * kDegreesPerRadian}};
    }
    seams.push_back(std::move(each));
  }
  return seams;
}

}  // namespace nodal::host
