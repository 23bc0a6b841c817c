// How far a head turns between two successive pictures of its film.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::motion {

/// Threading: thread-bound.
/// Memory: about 100 bytes for each pixel of the small pictures.
class HeadMotion {
 public:
  /// `width`, `height`: of the small pictures, which show all of the head's picture. Errors: those of check_head();
  /// kBadValue for pictures of less than 16 px or of more than the head's.
  static Result<HeadMotion> make(const HeadCalibration& calibration, int width, int height);

  /// The angle between this picture and the one before, rad. Nothing for the first one, and where the pictures have too
  /// little detail or too little in common. `grey`: width * height levels.
  std::optional<double> add(std::span<const std::uint8_t> grey);

 private:
  struct Pixel {
    int x = 0, y = 0;
    Eigen::Matrix<float, 2, 3> moves;  ///< d(pixel) / d(rotation), px of the level per rad
  };
  struct Level {
    int width = 0, height = 0;
    std::vector<Pixel> pixels;  ///< those that the head sees
    std::vector<float> before, now;
  };
  struct Motion {
    Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
    double gain = 1, offset = 0;
    double unlike = 0;  ///< part of the variance that the last pass found different
    bool good = true;
  };
  HeadMotion() = default;
  static void improve(const Level& level, Motion& motion);

  std::vector<Level> levels_;  ///< the finest first
  bool has_before_ = false;
};

}  // namespace nodal::motion
