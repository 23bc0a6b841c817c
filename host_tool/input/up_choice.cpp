#include "host_tool/input/up_choice.h"

#include <charconv>
#include <cmath>
#include <vector>

#include "host_tool/input/nominal_rig.h"
#include "host_tool/input/seen_part.h"
#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/autocalibration/stance.h"
#include "stitch/autocalibration/upright.h"
#include "stitch/geometry/rotation.h"
#include "stitch/geometry/turned_rig.h"
#include "stitch/media/exif/exif.h"

namespace nodal::host {
namespace {

/// How the heads stand, with the directions in their pictures that people call up.
Result<std::vector<autocalibration::HeldHead>> held_heads(RigPictures& rig) {
  std::vector<HeadPicture>& pictures = rig.sets[rig.match ? rig.match->set : 0];
  NODAL_TRY(decode_all(pictures, linear_heads(rig.calibration)));
  std::vector<autocalibration::HeldHead> heads;
  for (std::size_t h = 0; h < pictures.size(); ++h) {
    const Eigen::Matrix3d R = geometry::matrix_of(rig.calibration.heads[h].R_head_rig);
    const auto [x, y] = up_in(pictures[h]);
    heads.push_back({R.row(2).transpose(), (x * R.row(0) + y * R.row(1)).transpose()});
  }
  return heads;
}

/// "400,100", whatever their range.
bool is_two_numbers(const std::string& text) {
  const char *at = text.data(), *const end = text.data() + text.size();
  for (const char* const behind : {",", ""}) {
    double number = 0;
    const auto [after, error] = std::from_chars(at, end, number);
    if (after == at || std::isnan(number)) return false;
    if (*behind == '\0') return after == end;
    if (after == end || *after != *behind) return false;
    at = after + 1;
  }
  return false;
}

}  // namespace

std::array<double, 2> up_in(const HeadPicture& picture) {
  const DecodedImage& image = picture.pixels();
  const bool outdated = media::is_outdated(picture.orientation(), image.width, image.height);
  return media::up_of(outdated ? 1 : picture.orientation());
}

Result<UpChoice> parse_up(const std::string& text) {
  if (text == "auto") return UpChoice{};
  if (text == "pictures") return UpChoice{UpChoice::Kind::kPictures, 0, 0};
  const Result<NominalPlace> place = parse_place(text);
  if (!place || std::count(text.begin(), text.end(), ',') != 1) {
    if (!place && is_two_numbers(text)) {
      return fail(Errc::kBadValue,
                  "'" + text + "': YAW is a number from -360 to 360 and PITCH one from -90 to 90 degrees");
    }
    return fail(Errc::kBadValue, "'" + text +
                                     "': write auto, pictures, or the direction in the sphere that is up as YAW,PITCH: "
                                     "degrees to the right and up, such as 0,-90 for the bottom of the picture");
  }
  return UpChoice{UpChoice::Kind::kDirection, place->yaw, place->pitch};
}

Status turn_up(RigPictures& rig, const UpChoice& choice) {
  if (choice.kind == UpChoice::Kind::kAuto) return {};
  // The view of a camera that looks up there: its axis is up.
  Eigen::Vector3d up = geometry::to_R_head_rig({choice.yaw, choice.pitch, 0}).row(2).transpose();
  if (choice.kind == UpChoice::Kind::kPictures) {
    NODAL_TRY_ASSIGN(const auto heads, held_heads(rig));
    std::optional<Eigen::Vector3d> held = autocalibration::held_up(heads);
    if (!held) held = autocalibration::mostly_held_up(heads);
    if (!held) {
      return fail(
          Errc::kBadValue,
          "--up pictures: the pictures are held in different ways, so they do not say which way is up; give the "
          "direction as --up YAW,PITCH");
    }
    up = *held;
  }
  const bool alone = rig.origin == RigPictures::Origin::kPictures;
  const Eigen::Vector3d forward =
      alone ? Eigen::Vector3d(geometry::matrix_of(rig.calibration.heads.front().R_head_rig).row(2).transpose())
            : Eigen::Vector3d::UnitZ();
  rig.calibration = geometry::turned_rig(std::move(rig.calibration), autocalibration::upright_rotation(up, forward));
  return alone ? turn_to_middle(rig.calibration) : Status{};
}

}  // namespace nodal::host
