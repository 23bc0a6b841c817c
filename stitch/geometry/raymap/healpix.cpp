#include "stitch/geometry/raymap/healpix.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

/// The ring and longitude of the southernmost corner of each face: rings in units of a face from the zenith, longitudes
/// in units of pi / 4.
constexpr std::array kRing{2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4};
constexpr std::array kLongitude{1, 3, 5, 7, 0, 2, 4, 6, 1, 3, 5, 7};

/// The place on the sphere whose sine of latitude (upwards) is z.
Ray ray_of(double z, double cosine, double longitude) { return Ray::at(SinCos::of(longitude - kPi), {-z, cosine}); }

/// The ray at a place of a face: fx to the north-east, fy to the north-west, 0..1.
Ray ray_on(std::size_t face, double fx, double fy) {
  const double ring = kRing[face] - fx - fy;
  const double along = kLongitude[face] + fx - fy;
  if (ring >= 1 && ring <= 3) {
    const double z = (2 - ring) * 2 / 3;
    return ray_of(z, std::sqrt((1 - z) * (1 + z)), kPi / 4 * along);
  }
  // Towards a pole: the distance from it in rings, and 1 - |z| = d^2 / 3.
  const double d = ring < 1 ? ring : 4 - ring;
  const double cap = d * d / 3, z = ring < 1 ? 1 - cap : cap - 1;
  const double middle = kLongitude[face];
  return ray_of(z, std::sqrt(cap * (2 - cap)), d > 1e-15 ? kPi / 4 * (middle + (fx - fy) / d) : 0);
}

}  // namespace

Result<std::unique_ptr<RaymapLayout>> Healpix::make(RaymapSize size, std::int64_t) {
  if (size.width % 4 != 0 || size.width / 4 * 3 != size.height) {
    const int side = std::clamp((size.width + 2) / 4, 1, kMaxRaymapSide / 4);
    return fail(Errc::kBadValue,
                fmt::format("a healpix raymap is four by three square faces, and {}x{} is not; {}x{} would be",
                            size.width, size.height, 4 * side, 3 * side));
  }
  return std::unique_ptr<RaymapLayout>(new Healpix(size.width, size.height));
}

std::optional<Ray> Healpix::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  const int side = width() / 4;
  const int column = std::min(static_cast<int>(x) / side, 3), row = std::min(static_cast<int>(y) / side, 2);
  const double fx = x / side - column, fy = 1 - (y / side - row);
  return ray_on(static_cast<std::size_t>(4 * row + column), fx, fy);
}

double Healpix::solid_angle(int, int) const { return 4 * kPi / width() / height(); }

std::optional<Pixel> Healpix::pixel(const Ray& ray) const {
  const double side = width() / 4.0;
  const double z = -ray.y();
  // Longitude in quarter turns, 0..4.
  const double around = std::clamp((ray.angles().theta + kPi) * 2 / kPi, 0.0, std::nextafter(4.0, 0.0));
  double fx, fy;
  int face;
  if (std::abs(z) <= 2.0 / 3) {
    const double down = 0.5 + around - 0.75 * z, up = 0.5 + around + 0.75 * z;
    const int ifp = static_cast<int>(down), ifm = static_cast<int>(up);
    face = ifp == ifm ? (ifp | 4) : ifp < ifm ? ifp : ifm + 8;
    fx = up - ifm, fy = 1 - (down - ifp);
  } else {
    const int quarter = static_cast<int>(around);
    const double within = around - quarter;
    // sqrt(3 (1 - |z|)), exact near the poles.
    const double cosine = std::hypot(ray.x(), ray.z());
    const double d = cosine * std::sqrt(3 / (1 + std::abs(z)));
    const double down = std::min(1.0, within * d), up = std::min(1.0, (1 - within) * d);
    face = z >= 0 ? quarter : quarter + 8;
    fx = z >= 0 ? 1 - up : down, fy = z >= 0 ? 1 - down : up;
  }
  return Pixel{(face % 4 + fx) * side, (face / 4 + 1 - fy) * side};
}

std::vector<LayoutPatch> Healpix::patches() const {
  // Each face in two triangles: along fx + fy = 1, caps and belt meet. One that has a pole as its corner is a square
  // with one side at the pole, because meridians meet there at angles that they do not have on the sphere.
  std::vector<LayoutPatch> patches;
  for (std::size_t face = 0; face < kRing.size(); ++face) {
    for (const bool far : {false, true}) {
      const bool polar = kRing[face] == (far ? 2 : 4);
      patches.push_back({.triangle = !polar, .point = [this, face, far, polar](double u, double v) {
                           const double a = polar ? v * (1 - u) : u, b = polar ? v * u : v;
                           const double fx = far ? 1 - a : a, fy = far ? 1 - b : b, side = width() / 4.0;
                           return PatchPoint{{(static_cast<double>(face % 4) + fx) * side,
                                              (static_cast<double>(face / 4) + 1 - fy) * side},
                                             ray_on(face, fx, fy)};
                         }});
    }
  }
  return patches;
}

}  // namespace nodal::geometry
