#include "host_tool/output/turned_pose.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>

#include "stitch/geometry/rotation.h"

namespace nodal::host {
namespace {

/// One orientation in the metadata: three properties, of which some may be missing.
class Pose {
 public:
  Pose(media::XmpProperties& properties, const std::string& kind)
      : heading_(find(properties, "GPano:" + kind + "HeadingDegrees")),
        pitch_(find(properties, "GPano:" + kind + "PitchDegrees")),
        roll_(find(properties, "GPano:" + kind + "RollDegrees")) {}

  bool stated() const { return heading_ != nullptr || pitch_ != nullptr || roll_ != nullptr; }
  bool has_heading() const { return heading_ != nullptr; }
  geometry::YawPitchRoll degrees() const { return {number(heading_), number(pitch_), number(roll_)}; }
  /// Writes those that are there.
  void set(const geometry::YawPitchRoll& degrees) const {
    double heading = rounded(degrees.yaw);
    if (heading < 0) heading += 360;
    write(heading_, heading);
    write(pitch_, rounded(degrees.pitch));
    write(roll_, rounded(degrees.roll));
  }

 private:
  static media::XmpProperty* find(media::XmpProperties& properties, const std::string& name) {
    const auto found = std::ranges::find(properties, name, &media::XmpProperty::name);
    return found == properties.end() ? nullptr : &*found;
  }
  static double number(const media::XmpProperty* property) {
    if (property == nullptr) return 0;
    std::string_view text = property->value;
    if (text.starts_with('+')) text.remove_prefix(1);
    double value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value);  // parse_xmp() keeps numbers only
    return value;
  }
  /// To 0.001 degrees, a hundredth of a pixel of a sphere of 3600 columns; never -0.
  static double rounded(double degrees) { return std::round(degrees * 1000) / 1000 + 0.0; }
  static void write(media::XmpProperty* property, double value) {
    if (property != nullptr) property->value = fmt::format("{:g}", value);
  }

  media::XmpProperty* heading_;
  media::XmpProperty* pitch_;
  media::XmpProperty* roll_;
};

}  // namespace

void turn_pose(media::XmpProperties& properties, const Eigen::Matrix3d& R_new_old) {
  const Pose pose(properties, "Pose"), view(properties, "InitialView");
  if (!pose.has_heading() && view.stated()) {
    const Eigen::Matrix3d R_view_old = geometry::to_R_head_rig(view.degrees());
    view.set(geometry::to_yaw_pitch_roll(R_view_old * R_new_old.transpose()));
  }
  if (!pose.stated()) return;
  pose.set(geometry::to_yaw_pitch_roll(R_new_old * geometry::to_R_head_rig(pose.degrees())));
}

}  // namespace nodal::host
