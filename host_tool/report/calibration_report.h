// A calibration summarized for human readers: fields of view, orientations, coverage of the sphere.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tool/console/console.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

struct CalibratedHead {
  std::string name;
  int width = 0;
  int height = 0;
  std::string lens;             ///< "tsai", "rectilinear", "equidistant", "kannala_brandt"
  double horizontal_field = 0;  ///< degrees, through the lens's centre, within the region
  double vertical_field = 0;
  double yaw = 0, pitch = 0, roll = 0;  ///< degrees
};

struct CalibrationReport {
  std::string id;  ///< 64 hexadecimal digits
  std::string name;
  std::vector<CalibratedHead> heads;
  double unseen = 0;         ///< share of the sphere that no head sees, 0 .. 1
  double seen_twice = 0;     ///< share that at least two heads see
  double heads_per_ray = 0;  ///< mean number of heads that see a ray
  struct Direction {
    double yaw = 0, pitch = 0;  ///< degrees
  };
  std::optional<Direction> hole;  ///< a ray that no head sees
  struct MaskHole {
    std::string head;
    double solid_angle_sr = 0;  ///< hidden by this head's masks, and seen by no other head
  };
  std::vector<MaskHole> mask_holes;
  std::vector<std::string> mask_warnings;  ///< the same as sentences
};

/// Errors: those of make_heads().
Result<CalibrationReport> report_on(const Calibration& calibration);

Json to_json(const CalibrationReport& report);
void show(Console& console, const CalibrationReport& report);

}  // namespace nodal::host
