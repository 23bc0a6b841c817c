// The calibration: the rig document with every head's lens, orientation and radiometry. JSON on disk and on the wire;
// protocol/CALIBRATION.md explains every field with worked numbers. Angles here are in radians; pixel coordinates have
// corners at integers (a pixel's centre is at +1/2).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/base/sha256.h"

namespace nodal {

/// Simplified Tsai (§4.3). With r the radius in original pixels from the centre, aspect divided out:
/// r_ideal = r (1 + kappa1 r^2 + kappa2 r^4), tan(angle) = r_ideal / focal.
struct TsaiLens {
  double focal = 0;   ///< f_x of the ideal image, px
  double kappa1 = 0;  ///< px^-2
  double kappa2 = 0;  ///< px^-4
  friend bool operator==(const TsaiLens&, const TsaiLens&) = default;
};

/// Rectilinear with a radial polynomial from ideal to original: r = c1 t + c2 t^2 + ..., t = tan(angle), in px.
struct RectilinearLens {
  std::vector<double> coefficients;  ///< c1, c2, ... (1 to 9 of them); c1 is the focal length in px
  friend bool operator==(const RectilinearLens&, const RectilinearLens&) = default;
};

/// Equidistant fisheye (§6): r = f1 a + f2 a^2 + ..., a the angle from the axis in radians, r in px.
struct EquidistantLens {
  std::vector<double> coefficients;  ///< f1, f2, ... (1 to 9 of them); f1 in px per radian
  friend bool operator==(const EquidistantLens&, const EquidistantLens&) = default;
};

/// Kannala-Brandt, like OpenCV's fisheye module and Kalibr's "equidistant":
/// r = focal (a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9).
struct KannalaBrandtLens {
  double focal = 0;  ///< f_x, px
  std::array<double, 4> k{};
  friend bool operator==(const KannalaBrandtLens&, const KannalaBrandtLens&) = default;
};

using LensModel = std::variant<TsaiLens, RectilinearLens, EquidistantLens, KannalaBrandtLens>;

/// The usable part of a head's picture: the intersection of a rectangle and a circle, without the masks.
struct Region {
  double left = 0, top = 0, right = 0, bottom = 0;  ///< px; the whole picture is 0, 0, width, height
  struct Circle {
    double x = 0, y = 0, radius = 0;  ///< px
    friend bool operator==(const Circle&, const Circle&) = default;
  };
  std::optional<Circle> circle;
  struct Point {
    double x = 0, y = 0;  ///< px; may be outside the picture
    friend bool operator==(const Point&, const Point&) = default;
  };
  /// Closed polygons, at most kMaxMasks with kMaxMaskPoints corners in total. The area inside any of them is not used:
  /// a tripod, a hand, another head. Edges may cross each other; areas enclosed more than once are masked too.
  std::vector<std::vector<Point>> masks{};
  friend bool operator==(const Region&, const Region&) = default;
};

/// Encoded value (0..1) from relative light (0..1).
struct Response {
  enum class Curve : std::uint8_t { kLinear, kGamma, kSrgb, kPolynomial };
  Curve curve = Curve::kLinear;
  double gamma = 1.0;                ///< kGamma: encoded = light^(1/gamma)
  std::vector<double> coefficients;  ///< kPolynomial: light = c1 e + c2 e^2 + ..., rising, with sum 1
  friend bool operator==(const Response&, const Response&) = default;
};

/// Light falls off from (x, y) as V(r) = 1 + v1 s + v2 s^2 + v3 s^3, s = (r / radius)^2; r is measured with the lens's
/// aspect divided out. The picture's light is gain * V(r) * the scene's light.
struct Vignetting {
  double x = 0, y = 0;  ///< px
  double radius = 1;    ///< px
  std::array<double, 3> coefficients{};
  friend bool operator==(const Vignetting&, const Vignetting&) = default;
};

struct HeadCalibration {
  std::string name;
  int width = 0;  ///< px of the original image
  int height = 0;
  double center_x = 0;  ///< lens centre = principal point in the original image, px
  double center_y = 0;
  double aspect = 1;  ///< a_y: f_y = aspect * f_x (§4.1)
  LensModel lens;
  double max_angle = 0;  ///< rad; the lens is used up to this angle from its axis; 0: up to the end of its model
  std::array<double, 9> R_head_rig{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row-major, rig frame to head frame
  /// m, in the rig frame: the head's own nodal point, from the rig's. It moves rays only if Calibration::distance is
  /// set.
  std::array<double, 3> position{};
  Region region;
  Response response;
  Vignetting vignetting;
  std::array<double, 3> gain{1, 1, 1};  ///< red, green, blue, relative to the rig's mean
  friend bool operator==(const HeadCalibration&, const HeadCalibration&) = default;
};

/// A whole rig. A value returned by parse_calibration has been checked.
struct Calibration {
  std::string name;
  std::string comment;
  std::vector<HeadCalibration> heads;
  /// m: the rig's pictures meet on the sphere of this radius about its nodal point, so that what is this far away does
  /// not double. 0: infinity.
  double distance = 0;
  friend bool operator==(const Calibration&, const Calibration&) = default;
};

/// The newest version of the document: 2 has masks, 3 positions or a distance. A document has the lowest that it needs.
inline constexpr int kCalibrationVersion = 3;
inline constexpr std::size_t kMaxMasks = 16;        ///< per head
inline constexpr std::size_t kMaxMaskPoints = 256;  ///< sum over all masks of a head
inline constexpr std::size_t kMaxCalibrationBytes = 1 << 20;
inline constexpr double kFarthestPosition = 100;  ///< m
inline constexpr double kLongestDistance = 1e6;   ///< m
/// Lowest ratio of `distance` to the position of the farthest head.
inline constexpr double kMinDistancePerPosition = 1.25;

/// m from the rig's nodal point.
double farthest_position(const Calibration& calibration);

/// Parses and checks a document: all fields present and known, numbers finite and in range, rotations proper
/// to 1e-6 (then made orthonormal), lenses rising over their whole region. The error names the head and the
/// field.
Result<Calibration> parse_calibration(std::string_view json);

/// The same checks for a value created in memory.
Status check_calibration(const Calibration& calibration);
/// The checks that concern one head only.
Status check_head(const HeadCalibration& head);

/// The document for human readers: indented, fields in the order of CALIBRATION.md.
std::string to_json(const Calibration& calibration);

/// The canonical form: sorted keys, no white space, shortest numbers that read back exactly. Its SHA-256 identifies the
/// calibration everywhere.
std::string canonical_json(const Calibration& calibration);
Sha256 calibration_id(const Calibration& calibration);

}  // namespace nodal
