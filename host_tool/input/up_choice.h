// Which direction of a rig is up: the option --up.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "host_tool/input/rig_pictures.h"
#include "protocol/base/result.h"

namespace nodal::host {

struct UpChoice {
  enum class Kind : std::uint8_t {
    kAuto,      ///< as the calibration has it; without one, as it is found in the pictures
    kPictures,  ///< as most of the pictures are held, by their Exif orientation
    kDirection
  };
  Kind kind = Kind::kAuto;
  double yaw = 0, pitch = 0;  ///< kDirection: degrees to the right and up, in the rig as kAuto leaves it
};

/// "auto", "pictures", or "90,-30". Errors: kBadValue.
Result<UpChoice> parse_up(const std::string& text);

/// The direction in a decoded picture, x right and y down, that is up for people who look at it. An orientation that is
/// outdated (media::is_outdated) does not count.
std::array<double, 2> up_in(const HeadPicture& picture);

/// Turns the calibration so that this direction is up. What was forward stays at yaw 0: the rig's own axis, or if the
/// calibration is from pictures alone, that of the first picture, or the middle of them (turn_to_middle()). kPictures
/// decodes the first set, or the matched one.
/// Errors: those of reading pictures; kBadValue if the pictures are held in different ways.
Status turn_up(RigPictures& rig, const UpChoice& choice);

}  // namespace nodal::host
