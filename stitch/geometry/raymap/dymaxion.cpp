#include "stitch/geometry/raymap/dymaxion.h"

#include <array>
#include <cmath>

#include "stitch/geometry/raymap/polyhedron.h"

namespace nodal::geometry {
namespace {

/// Half the angle between two corners of an icosahedron, atan(2) / 2, and its tangent.
constexpr double kHalfEdge = 0.55357435889704525, kTangent = 0.61803398874989485;

/// Per coordinate: the angle along an edge, 0 to 1, of the gnomonic coordinate b, and back.
double angle_of(double b) { return 0.5 + std::atan((2 * b - 1) * kTangent) / (2 * kHalfEdge); }
double slope_at(double angle) {
  const double cosine = std::cos((2 * angle - 1) * kHalfEdge);
  return kHalfEdge / (kTangent * cosine * cosine);
}

/// With g_i the angles of a point's three gnomonic coordinates, the map's coordinates are
/// g_i + (1 - g_1 - g_2 - g_3) / 3: the three great circles do not meet on the map, and the middle of the small
/// triangle between them is taken.
class Fuller final : public FaceScale {
 public:
  Eigen::Vector3d to_map(const Eigen::Vector3d& b) const override {
    const Eigen::Vector3d g = b.unaryExpr(&angle_of);
    return g.array() + (1 - g.sum()) / 3;
  }
  /// The g_i are the map's coordinates plus one number: that at which the gnomonic coordinates sum to 1. With t_i the
  /// tangents of the map's angles and x that of the number's, tan(a + b) = (t + x) / (1 - t x): Newton on x, without
  /// trigonometry.
  Eigen::Vector3d from_map(const Eigen::Vector3d& map) const override {
    const Eigen::Array3d t =
        ((2 * map.array() - 1) * kHalfEdge).unaryExpr([](double angle) { return std::tan(angle); });
    double x = 0;
    Eigen::Array3d moved = t;
    for (int step = 0; step < 8; ++step) {
      const Eigen::Array3d under = 1 / (1 - t * x);
      moved = (t + x) * under;
      const double change = (moved.sum() + kTangent) / ((1 + t.square()) * under.square()).sum();
      x -= change;
      if (std::abs(change) < 1e-9) break;  // the next one would be under 1e-16
    }
    moved = (t + x) / (1 - t * x);
    return 0.5 + moved / (2 * kTangent);
  }
};

/// A corner of the Earth's icosahedron (Gray 1995): x towards Greenwich, z north.
struct EarthPoint {
  double x, y, z;
};
constexpr std::array<EarthPoint, 6> kCorners{{{0.420152426708710003, 0.078145249402782959, 0.904082550615019298},
                                              {0.995009439436241649, -0.091347795276427931, 0.040147175877166645},
                                              {0.518836730327364437, 0.835420380378235850, 0.181331837557262454},
                                              {-0.414682225320335218, 0.655962405434800777, 0.630675807891475371},
                                              {-0.515455959944041808, -0.381716898287133011, 0.767200992517747538},
                                              {0.355781402532944713, -0.843580002466178147, 0.402234226602925571}}};

/// Corners 1 to 6 as above, and 7 to 12 opposite of 4, 5, 6, 2, 3 and 1; in the rig's axes.
Eigen::Vector3d corner(int number) {
  constexpr std::array kOpposite{4, 5, 6, 2, 3, 1};
  if (number > 6) return -corner(kOpposite[static_cast<std::size_t>(number) - 7]);
  const EarthPoint& at = kCorners[static_cast<std::size_t>(number) - 1];
  return {at.y, -at.z, at.x};
}

/// Where a corner is on the net: half edges from the left, rows of triangles from the bottom.
struct Place {
  int corner, x, row;
};
constexpr std::array<std::array<Place, 3>, 20> kNet{{
    {{{1, 5, 2}, {2, 4, 3}, {3, 3, 2}}},    {{{1, 5, 2}, {3, 3, 2}, {4, 4, 1}}},
    {{{1, 5, 2}, {4, 4, 1}, {5, 6, 1}}},    {{{1, 5, 2}, {5, 6, 1}, {6, 7, 2}}},
    {{{1, 5, 2}, {6, 6, 3}, {2, 4, 3}}},    {{{2, 4, 3}, {8, 2, 3}, {3, 3, 2}}},
    {{{3, 3, 2}, {8, 1, 2}, {9, 2, 1}}},    {{{3, 3, 2}, {9, 2, 1}, {4, 4, 1}}},
    {{{4, 4, 1}, {9, 2, 1}, {10, 3, 0}}},   {{{4, 4, 1}, {10, 5, 0}, {5, 6, 1}}},
    {{{5, 6, 1}, {10, 7, 0}, {11, 8, 1}}},  {{{5, 6, 1}, {11, 8, 1}, {6, 7, 2}}},
    {{{6, 7, 2}, {11, 8, 1}, {7, 9, 2}}},   {{{2, 8, 3}, {6, 7, 2}, {7, 9, 2}}},
    {{{2, 10, 3}, {7, 9, 2}, {8, 11, 2}}},  {{{8, 0, 1}, {12, 1, 0}, {9, 2, 1}}},
    {{{9, 2, 1}, {12, 1, 0}, {10, 3, 0}}},  {{{10, 7, 0}, {12, 9, 0}, {11, 8, 1}}},
    {{{11, 8, 1}, {12, 10, 1}, {7, 9, 2}}}, {{{8, 11, 2}, {7, 9, 2}, {12, 10, 1}}},
}};

}  // namespace

Result<std::unique_ptr<RaymapLayout>> make_dymaxion(RaymapSize size, std::int64_t) {
  std::vector<Polyhedron::Triangle> triangles;
  for (const std::array<Place, 3>& face : kNet) {
    const auto at = [&](const Place& place) {
      return Polyhedron::Corner{{place.x / 11.0, 1 - place.row / 3.0}, corner(place.corner)};
    };
    triangles.push_back({at(face[0]), at(face[1]), at(face[2])});
  }
  static const Fuller scale;
  return std::make_unique<Polyhedron>("dymaxion", size, triangles, &scale);
}

double dymaxion_radians_across() {
  // Edges of length 1; the slope is isotropic in the middle.
  return 5.5 * slope_at(angle_of(1.0 / 3)) / kIcosahedronInradius;
}

}  // namespace nodal::geometry
