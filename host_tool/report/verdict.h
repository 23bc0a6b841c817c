// What a person would say of a raymap, in one word: the same in the terminal, in JSON and on the page.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "host_tool/console/console.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/offline/seam_check.h"

namespace nodal::host {

struct Verdict {
  offline::SeamVerdict word = offline::SeamVerdict::kGood;
  std::string sentence;  ///< "good: …", "usable: …" or "look at the seam between 'a' and 'b' …: …"
  std::vector<offline::SeamCheck> seams;  ///< worst first
};

/// "good", "usable" or "look".
const char* name_of(offline::SeamVerdict word);

/// `heads`: their names. `left_out`: number of pictures that were given and are not in the raymap.
Verdict verdict_of(std::vector<offline::SeamCheck> seams, const std::vector<std::string>& heads, std::size_t left_out);

/// The verdict on the sphere, as fine as the heads' pictures, that a board would blend of one set of frames.
/// Errors: those of geometry::make_heads.
Result<Verdict> verdict_on(const Calibration& calibration, std::span<const ImageView> frames);

/// How much lines jump at a seam, or that it shows different things, for people: "lines jump by up to 3 px".
std::string text_of(const offline::SeamCheck& seam);

/// "yaw 30°, pitch -10°".
std::string text_of(const geometry::Angles& at);

/// The seams with the heads' names, what was measured, and where to look.
Json to_json(const Verdict& verdict, const std::vector<std::string>& heads);

}  // namespace nodal::host
