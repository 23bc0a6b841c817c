// How a camera moves from picture to picture.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/view/camera.h"

namespace nodal::view {

/// A camera's direction and field of view in one picture.
struct CameraKey {
  std::int64_t picture = 0;  ///< counted from 0
  geometry::YawPitchRoll pose;
  double fov_deg = 90;
};

/// Direction and field of view between keys: each number follows a cubic of its own, smooth at the keys, and stays
/// between the numbers of the two keys (Fritsch and Carlson, "Monotone Piecewise Cubic Interpolation", 1980). Angles
/// are not taken modulo a turn: from 0 to 720 the camera turns twice. Before the first key and after the last the
/// camera rests.
///
/// Threading: immutable; any thread.
class CameraPath {
 public:
  static constexpr std::size_t kMaxKeys = 100'000;
  static constexpr std::int64_t kMaxPictures = 10'000'000;

  /// Parses lines "picture,yaw,pitch,roll,fov", in degrees, with rising pictures. Ignores empty lines, text after #,
  /// and a first line with these names. Errors: kBadValue with the line; kTooLarge.
  static Result<CameraPath> parse(std::string_view text);

  const std::vector<CameraKey>& keys() const { return keys_; }
  /// The direction and field of view in a picture.
  CameraKey at(std::int64_t picture) const;

 private:
  explicit CameraPath(std::vector<CameraKey> keys);

  std::vector<CameraKey> keys_;
  std::vector<CameraKey> slopes_;  ///< slope of every number at each key, per picture
};

}  // namespace nodal::view
