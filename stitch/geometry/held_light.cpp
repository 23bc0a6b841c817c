#include "stitch/geometry/held_light.h"

#include <algorithm>

namespace nodal::geometry {
namespace {

constexpr double kMinGain = 0.01, kMaxGain = 100;  // check_head()'s
constexpr int kHalvings = 30;

HeadCalibration with_share(HeadCalibration head, double share) {
  for (double& coefficient : head.vignetting.coefficients) coefficient *= share;
  return head;
}

}  // namespace

bool hold_light(HeadCalibration& head) {
  if (check_head(head)) return false;
  HeadCalibration held = head;
  for (double& gain : held.gain) gain = std::clamp(gain, kMinGain, kMaxGain);
  if (check_head(held)) {
    head = held;
    return true;
  }
  if (!check_head(with_share(held, 0))) return false;
  // The light that is left is 1 plus what the coefficients add, so it rises as their share falls.
  double good = 0, bad = 1;
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = (good + bad) / 2;
    (check_head(with_share(held, middle)) ? good : bad) = middle;
  }
  head = with_share(held, good);
  return true;
}

}  // namespace nodal::geometry
