#include "stitch/registration/diagnosis.h"

#include <numeric>

namespace nodal::registration {
namespace {

constexpr std::size_t kMaxSingles = 12;  // heads that are tried one by one

enum class Mistake : std::uint8_t { kUpsideDown, kMirrored };

// Views the same bytes in reverse order.
ImageView undone(ImageView image, Mistake mistake) {
  for (int c = 0; c < component_count(image.format); ++c) {
    PlaneView& plane = image.planes[static_cast<std::size_t>(c)];
    plane.data += static_cast<std::ptrdiff_t>(plane.width - 1) * plane.pixel_stride;
    plane.pixel_stride = -plane.pixel_stride;
    if (mistake == Mistake::kMirrored) continue;
    plane.data += (plane.height - 1) * plane.row_stride;
    plane.row_stride = -plane.row_stride;
  }
  return image;
}

std::string said(const Calibration& prior, const std::vector<std::size_t>& heads, Mistake mistake) {
  std::string who;
  for (const std::size_t h : heads) who += (who.empty() ? "'" : ", '") + prior.heads[h].name + "'";
  const bool all = heads.size() == prior.heads.size();
  who = all ? "all heads" : heads.size() == 1 ? "head " + who : "heads " + who;
  const bool one = heads.size() == 1;
  if (mistake == Mistake::kUpsideDown) {
    return who + (one ? " is" : " are") + " upside down; turn " + (one ? "its picture" : "their pictures") +
           ", or roll " + (one ? "it" : "them") + " by 180 degrees in the calibration";
  }
  return "the " + std::string(one ? "picture" : "pictures") + " of " + who + (one ? " is" : " are") +
         " mirrored, left for right; switch the camera's flip off, or mirror " + (one ? "it" : "them") + " back";
}

}  // namespace

std::optional<std::string> usual_mistake(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                                         const std::vector<std::size_t>& wrong, const Attempt& attempt) {
  std::vector<std::size_t> all(prior.heads.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::vector<std::vector<std::size_t>> suspects{wrong};
  if (wrong != all) suspects.push_back(all);  // some heads may agree by chance
  // One wrong head may affect all its neighbours. If very many heads disagree, the cause is another one.
  const bool singles = wrong.size() > 1 && wrong.size() <= kMaxSingles;
  for (std::size_t k = 0; singles && k < wrong.size(); ++k) suspects.push_back({wrong[k]});
  for (const std::vector<std::size_t>& heads : suspects) {
    for (const Mistake mistake : {Mistake::kUpsideDown, Mistake::kMirrored}) {
      std::vector<FrameSet> tried = frame_sets;
      for (FrameSet& frames : tried) {
        for (const std::size_t h : heads) frames[h] = undone(frames[h], mistake);
      }
      if (attempt(tried)) return said(prior, heads, mistake);
    }
  }
  return std::nullopt;
}

}  // namespace nodal::registration
