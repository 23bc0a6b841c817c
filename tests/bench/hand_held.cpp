#include "tests/bench/hand_held.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>

#include "protocol/base/angles.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/import.h"
#include "stitch/solve/robust.h"
#include "tests/support/process.h"
#include "tests/support/rigs.h"

namespace nodal::bench {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr int kWidth = 576, kHeight = 384;  // px
constexpr double kViewDeg = 66;
constexpr double kHidden = 0.02;  // m; a point farther behind what a head sees is hidden
constexpr int kPointsOfHead = 120;
constexpr auto kLongest = std::chrono::seconds(300);

std::array<double, 3> numbers_of(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Vector3d vector_of(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

/// The point of the scene that a head shows at a pixel, m.
Vector3d scene_point(const test::Room& room, const geometry::Head& head, geometry::Pixel at) {
  const Vector3d ray = head.unproject(at)->direction();
  return vector_of(head.calibration().position) + range_in(room, head.calibration().position, numbers_of(ray)) * ray;
}

/// Where a head shows a point of the scene; nothing if it is outside of its picture, or hidden.
std::optional<geometry::Pixel> shown(const test::Room& room, const geometry::Head& head, const Vector3d& point) {
  const Vector3d from_head = point - vector_of(head.calibration().position);
  const Vector3d ray = from_head.normalized();
  const auto at = head.project(geometry::Ray::towards(ray.x(), ray.y(), ray.z()));
  if (!at || !head.contains(*at)) return std::nullopt;
  const double range = range_in(room, head.calibration().position, numbers_of(ray));
  return range > from_head.norm() - kHidden ? at : std::nullopt;
}

Status ran(const std::vector<std::string>& command) {
  test::Process process(command);
  const test::Finished finished = process.wait(kLongest);
  if (finished.code == 0) return {};
  return fail(Errc::kIo, command.front() + ": " + finished.err + finished.out);
}

/// The pictures that a project's control points name.
std::vector<bool> with_points(const std::string& project, std::size_t pictures) {
  std::vector<bool> named(pictures);
  std::istringstream lines(project);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("c ")) continue;
    std::istringstream words(line);
    for (std::string word; words >> word;) {
      if (word.size() < 2 || (word[0] != 'n' && word[0] != 'N')) continue;
      const std::size_t picture = std::stoul(word.substr(1));
      if (picture < pictures) named[picture] = true;
    }
  }
  return named;
}

}  // namespace

HandHeldSet hand_held_set(int number) { return {0.05 * (number % 5), number % 4 >= 2, number % 2 == 1}; }

Calibration true_hands(const HandHeldSet& set, int seed) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed) + 99);
  std::uniform_real_distribution<double> unit(-1, 1);
  Calibration rig;
  rig.name = "hand";
  const int pictures = 10 + seed % 4;
  for (int h = 0; h < pictures; ++h) {
    HeadCalibration head = test::plain_head("p" + std::to_string(h), kWidth, kHeight, 0, kViewDeg);
    if (set.own_lenses) std::get<RectilinearLens>(head.lens).coefficients[0] *= 1 + 0.01 * unit(random);
    head.R_head_rig = geometry::rows_of(
        geometry::to_R_head_rig({360.0 * h / pictures + 3 * unit(random), 4 * unit(random), 3 * unit(random)}));
    head.position = {set.moved * unit(random), set.moved * unit(random) / 2, set.moved * unit(random)};
    head.gain.fill(1 + 0.1 * unit(random));
    rig.heads.push_back(head);
  }
  return rig;
}

test::Room room_of(const HandHeldSet& set) {
  test::Room room{test::Room::Shape::kBox, 6};
  if (set.near) room.columns = {{1.5, 1.0, 0.2}, {-1.2, 1.4, 0.2}, {-1.0, -1.6, 0.2}};
  return room;
}

test::RenderedRig rendered_hands(const HandHeldSet& set, const Calibration& truth, int seed) {
  const auto town = hal::sim::town_square_scene(static_cast<std::uint64_t>(seed) + 1);
  return test::render_rig_in(room_of(set), truth, town,
                             {PixelFormat::kRgb24, 1.0, static_cast<std::uint64_t>(seed) + 1, 2});
}

std::vector<KeptPoint> kept_points(const test::Room& room, const Calibration& truth, int seed) {
  const auto heads = geometry::make_heads(truth).value();
  std::mt19937_64 random(static_cast<std::uint64_t>(seed) + 4711);
  std::uniform_real_distribution<double> part(0, 1);
  std::vector<KeptPoint> points;
  for (std::size_t a = 0; a < heads.size(); ++a) {
    for (int n = 0; n < kPointsOfHead; ++n) {
      const geometry::Pixel at{part(random) * heads[a].width(), part(random) * heads[a].height()};
      const Vector3d point = scene_point(room, heads[a], at);
      for (std::size_t b = 0; b < heads.size(); ++b) {
        if (b == a) continue;
        if (const auto projected = shown(room, heads[b], point)) points.push_back({a, b, at, *projected});
      }
    }
  }
  return points;
}

HandErrors errors_of(const Calibration& truth, const Placed& placed, const std::vector<bool>& counted,
                     const std::vector<KeptPoint>& points) {
  Calibration is = truth, found = truth;
  is.heads.clear();
  found.heads.clear();
  std::vector<std::optional<geometry::Head>> heads(placed.size());
  for (std::size_t h = 0; h < placed.size(); ++h) {
    if (!counted[h]) continue;
    is.heads.push_back(truth.heads[h]);
    found.heads.push_back(*placed[h]);
    if (auto head = geometry::Head::make(*placed[h])) heads[h] = *std::move(head);
  }
  const test::RotationError rotations = test::rotation_error(is, found);
  std::vector<double> angles;
  for (const KeptPoint& point : points) {
    if (!heads[point.a] || !heads[point.b]) continue;
    const auto a = heads[point.a]->unproject(point.at_a), b = heads[point.b]->unproject(point.at_b);
    if (!a || !b) continue;
    const Vector3d u = a->direction(), v = b->direction();
    angles.push_back(std::atan2(u.cross(v).norm(), u.dot(v)) * kDegreesPerRadian);
  }
  return {rotations.rms_deg, rotations.max_deg, angles.empty() ? 0 : solve::median(angles)};
}

Result<Placed> placed_by_hugin(const std::vector<std::string>& files, double view_deg, const fs::path& folder) {
  const auto in = [&](const char* name) { return (folder / name).string(); };
  std::vector<std::string> generate{"pto_gen", "-p", "0", "-f", std::to_string(view_deg), "-o", in("start.pto")};
  generate.insert(generate.end(), files.begin(), files.end());
  for (const std::vector<std::string>& command :
       {generate,
        std::vector<std::string>{"cpfind", "--multirow", "-o", in("points.pto"), in("start.pto")},
        {"cpclean", "-o", in("clean.pto"), in("points.pto")},
        {"autooptimiser", "-a", "-l", "-o", in("found.pto"), in("clean.pto")}}) {
    if (const Status done = ran(command); !done) return fail(done.error());
  }
  std::ifstream stream(in("found.pto"));
  const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const auto project = interchange::import_pto(text, "hugin");
  if (!project) return fail(project.error());
  const std::vector<bool> named = with_points(text, files.size());
  Placed placed(files.size());
  for (std::size_t h = 0; h < std::min(files.size(), project->calibration.heads.size()); ++h) {
    if (named[h]) placed[h] = project->calibration.heads[h];
  }
  return placed;
}

}  // namespace nodal::bench
