// A filming rig of which one head was moved after its calibration.
#pragma once

#include <cmath>
#include <numbers>

#include "rig_process.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {

inline constexpr int kSide = 192;
inline constexpr double kBumpDeg = 0.4;
inline constexpr std::size_t kBumped = 3;

inline Calibration six(const std::string& name) {
  Calibration rig = test::six_fisheyes(kSide);
  rig.name = name;
  return rig;
}

/// Rotates the head to its right.
inline Calibration bumped(Calibration rig, std::size_t head, double degrees) {
  std::array<double, 9>& R = rig.heads[head].R_head_rig;
  const double c = std::cos(degrees * std::numbers::pi / 180), s = std::sin(degrees * std::numbers::pi / 180);
  for (std::size_t column = 0; column < 3; ++column) {
    const double x = R[column], z = R[6 + column];
    R[column] = c * x - s * z;
    R[6 + column] = s * x + c * z;
  }
  return rig;
}

class BumpedRig : public RigTest {
 protected:
  BumpedRig() {
    write("six.json", to_json(six("six")));
    write("truth.json", to_json(bumped(six("truth"), kBumped, kBumpDeg)));
  }
  void film() {
    start_nodald();
    bring_up();
  }
  Json drift() const { return Json::parse(nodal({"--json", "drift", "--tolerance", "0.2"}).out); }
  /// Whether a calibration is on trial. Also reads nodald's log, which would otherwise fill the pipe.
  bool on_trial() {
    (void)nodald().complained();
    return !nodal_json({"status"}).at(0)["trial"].is_null();
  }
  std::string in_force() const { return nodal_json({"status"}).at(0)["calibration_id"]; }
  static std::string id_of(const Calibration& calibration) { return to_hex(calibration_id(calibration)); }
};

}  // namespace nodal::command_line
