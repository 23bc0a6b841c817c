// Views as triangles against views by rays.
#include "stitch/mesh/rasteriser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "stitch/geometry/envelope/envelope.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/raymap/registry.h"
#include "stitch/mesh/of_layout.h"
#include "stitch/view/resampler.h"
#include "tests/support/layouts.h"

namespace nodal::mesh {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using geometry::Envelope;
using geometry::Ray;
using test::layout_of;

constexpr double kOneDegree = std::numbers::pi / 180;

view::CameraSpec camera_of(double yaw, double pitch, double fov) {
  return {{view::Projection::kPerspective}, {yaw, pitch, 10}, fov, 120, 90};
}

/// The largest angle, rad, between what the two ways say that a pixel shows; and how many pixels only one of them
/// fills.
struct Apart {
  double angle = 0;
  int alone = 0, both = 0;
};

Apart apart(const geometry::RaymapLayout& layout, const Envelope& envelope, const view::CameraSpec& spec,
            const Vector3d& eye, double error) {
  const parallel::Workers workers(2);
  const Raymesh mesh = mesh_of_layout(layout, envelope, error).value().mesh;
  const MeshView view = MeshView::make(mesh, spec, eye, workers).value();
  const view::Camera camera = view::Camera::make(spec).value();
  Apart result;
  for (int y = 0; y < spec.height; ++y) {
    for (int x = 0; x < spec.width; ++x) {
      const std::optional<Vector3d> point = envelope.seen(eye, camera.ray(x + 0.5, y + 0.5).value());
      const std::optional<Vector2d> texture = view.texture(x, y);
      if (point.has_value() != texture.has_value()) ++result.alone;
      if (!point || !texture) continue;
      ++result.both;
      // The weights have 24 bits: a place at a seam may be rounded into the patch beside.
      double nearest = 10;
      for (const double dx : {0.0, -1e-3, 1e-3}) {
        for (const double dy : {0.0, -1e-3, 1e-3}) {
          const double u = std::clamp(texture->x() * layout.width() + dx, 0.0, 1.0 * layout.width());
          const double v = std::clamp(texture->y() * layout.height() + dy, 0.0, 1.0 * layout.height());
          const std::optional<Ray> ray = layout.ray(u, v);
          if (ray) nearest = std::min(nearest, angle_between(*ray, Ray::towards(*point)));
        }
      }
      result.angle = std::max(result.angle, nearest);
    }
  }
  return result;
}

TEST(MeshView, FromTheNodalPoint_ShowsWhatRaysShow_WithinTheStatedError) {
  const Envelope sphere = Envelope::named("sphere:1").value();
  for (const std::string name : {"equirectangular", "cube", "equiangular_cube", "octahedron", "icosahedron", "dymaxion",
                                 "dual_fisheye", "sinusoidal", "healpix", "compressed_spherical"}) {
    const auto layout = layout_of(name, 192);
    for (const auto& [yaw, pitch] : {std::pair(0.0, 0.0), std::pair(100.0, 40.0), std::pair(-170.0, -90.0)}) {
      const Apart found = apart(*layout, sphere, camera_of(yaw, pitch, 100), Vector3d::Zero(), 0.3 * kOneDegree);
      EXPECT_EQ(found.alone, 0) << name << ": a pixel between triangles";
      EXPECT_LE(found.angle, 0.3 * kOneDegree + 1e-4) << name << " yaw " << yaw;
    }
  }
}

TEST(MeshView, FlatEnvelopes_AreShownExactly_FromInsideAndOutside) {
  // A cube's raymap on a cube, an octahedron's on an octahedron: between corners the place is linear, whatever the eye.
  for (const std::string name : {"cube", "octahedron"}) {
    const Envelope envelope = Envelope::named(name + ":2").value();
    const auto layout = layout_of(name, 192);
    const Apart inside = apart(*layout, envelope, camera_of(20, 10, 110), {0.3, -0.2, 0.25}, 0.01 * kOneDegree);
    EXPECT_EQ(inside.alone, 0) << name;
    EXPECT_LE(inside.angle, 1e-4) << name;
    const Apart outside = apart(*layout, envelope, camera_of(-25, -18, 70), {1.5, -1.2, -3}, 0.01 * kOneDegree);
    EXPECT_LE(outside.alone, 2) << name << ": but for rounding at the silhouette";
    EXPECT_GT(outside.both, 1000) << name;
    EXPECT_LE(outside.angle, 1e-4) << name;
  }
}

TEST(MeshView, CurvedEnvelopes_FromBesideAndOutside_AgreeUpToTheMeshsFlatness) {
  const Envelope sphere = Envelope::named("sphere:2").value();
  const auto layout = layout_of("equirectangular", 192);
  // The flat triangles of a mesh with the error 0.05 degrees are up to a few centimetres below the sphere; from
  // elsewhere than the nodal point, this is an angle too. Halving edges divides it by four.
  const Apart coarse = apart(*layout, sphere, camera_of(0, 0, 90), {0.5, 0.3, -0.4}, 0.2 * kOneDegree);
  const Apart fine = apart(*layout, sphere, camera_of(0, 0, 90), {0.5, 0.3, -0.4}, 0.05 * kOneDegree);
  EXPECT_EQ(fine.alone, 0);
  EXPECT_LE(fine.angle, 0.5 * kOneDegree);
  EXPECT_LE(fine.angle, 0.5 * coarse.angle);
  const Apart outside = apart(*layout, sphere, camera_of(0, 0, 70), {0, 0, -5}, 0.02 * kOneDegree);
  EXPECT_GT(outside.both, 1500);
  EXPECT_LE(outside.alone, outside.both / 50) << "the rim of a mesh is inside of the sphere's";
}

/// A scene without detail that pixels would miss.
std::uint8_t level(const Ray& ray) {
  return static_cast<std::uint8_t>(
      std::lround(128 + 60 * std::sin(3 * ray.x() + 1) + 50 * std::cos(4 * ray.y() - 2 * ray.z())));
}

TEST(MeshView, Pictures_AreThoseOfTheResampler_AlsoOfScatteredLayouts) {
  const Envelope sphere = Envelope::named("sphere:1").value();
  const parallel::Workers workers(2);
  for (const std::string name : {"equirectangular", "cube:pad=2", "dual_paraboloid", "hammersley"}) {
    const auto layout = layout_of(name, 256);
    DecodedImage raymap{PixelFormat::kGrey8, layout->width(), layout->height(), {}};
    for (int j = 0; j < layout->height(); ++j) {
      for (int i = 0; i < layout->width(); ++i) {
        const std::optional<Ray> ray = layout->ray(i + 0.5, j + 0.5);
        raymap.bytes.push_back(ray ? level(*ray) : std::uint8_t{0});
      }
    }
    const view::CameraSpec spec = camera_of(70, 20, 90);
    const Raymesh mesh = mesh_of_layout(*layout, sphere, 0.05 * kOneDegree).value().mesh;
    const MeshView view = MeshView::make(mesh, spec, Vector3d::Zero(), workers).value();
    const DecodedImage triangles = view.paint(raymap.view(), layout->scattered(), workers);
    const view::Camera camera = view::Camera::make(spec).value();
    const view::Resampler resampler(*layout, view::Filter::kBilinear, workers);
    const view::Target target{spec.width, spec.height, [&](double x, double y) { return camera.ray(x, y); }, 0, true};
    const DecodedImage rays = resampler.resample(raymap.view(), target, workers);
    double sum = 0;
    for (std::size_t k = 0; k < rays.bytes.size(); ++k) sum += std::pow(rays.bytes[k] - triangles.bytes[k], 2);
    EXPECT_LE(std::sqrt(sum / static_cast<double>(rays.bytes.size())), 1.5) << name << ": levels, root of mean square";
  }
}

TEST(MeshView, Of16Bits_IsThatOf8BitsTimes257UpToRounding) {
  const parallel::Workers workers(2);
  for (const std::string name : {"cube:pad=2", "hammersley"}) {
    const auto layout = layout_of(name, 128);
    DecodedImage raymap{PixelFormat::kGrey8, layout->width(), layout->height(), {}};
    DecodedImage deep{PixelFormat::kGrey16, layout->width(), layout->height(), {}};
    for (int k = 0; k < raymap.width * raymap.height; ++k) {
      const auto value = static_cast<std::uint8_t>(k * 89 + k / 7);
      raymap.bytes.push_back(value);
      deep.bytes.insert(deep.bytes.end(), {value, value});  // 257 times the value
    }
    const Raymesh mesh = mesh_of_layout(*layout, Envelope::named("sphere:1").value(), 0.05 * kOneDegree).value().mesh;
    const MeshView view = MeshView::make(mesh, camera_of(70, 20, 90), Vector3d::Zero(), workers).value();
    const DecodedImage in_8 = view.paint(raymap.view(), layout->scattered(), workers);
    const DecodedImage in_16 = view.paint(deep.view(), layout->scattered(), workers);
    ASSERT_EQ(in_16.bytes.size(), 2 * in_8.bytes.size());
    int finer = 0;
    for (std::size_t k = 0; k < in_8.bytes.size(); ++k) {
      const int got = in_16.bytes[2 * k] | in_16.bytes[2 * k + 1] << 8;
      ASSERT_NEAR(got, 257 * in_8.bytes[k], 129.5) << k;
      if (got % 257 != 0) ++finer;
    }
    EXPECT_GT(finer, static_cast<int>(in_8.bytes.size() / 2)) << name;
  }
}

TEST(MeshView, OtherCameras_AreRefused) {
  const Raymesh mesh = mesh_of_layout(*layout_of("cube", 48), Envelope::named("cube:2").value(), 1).value().mesh;
  view::CameraSpec spec = camera_of(0, 0, 90);
  spec.name.projection = view::Projection::kFisheye;
  const auto view = MeshView::make(mesh, spec, Vector3d::Zero(), parallel::Workers(1));
  ASSERT_FALSE(view);
  EXPECT_EQ(view.error().code, Errc::kUnsupported);
}

}  // namespace
}  // namespace nodal::mesh
