// Rigs of which nothing is known but their pictures, against the truth: pairs of fisheyes back to back, and sets of pictures
// taken from the hand. Renders them with the simulator, which shares no projection code with the stitcher.
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <random>

#include "host_tool/input/own_pictures.h"
#include "stitch/autocalibration/matches.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/geometry/rotation.h"
#include "tests/reference/png_file.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::bench {
namespace {

namespace fs = std::filesystem;
constexpr double kDegree = std::numbers::pi / 180;
constexpr int kSide = 720;

/// Stripes and tiles that repeat, on a ball.
class Tiles final : public hal::sim::Scene {
 public:
  hal::sim::Light light(const hal::sim::Direction& d, double) const override {
    const double yaw = std::atan2(d.x, d.z) / kDegree, pitch = std::asin(std::clamp(-d.y, -1.0, 1.0)) / kDegree;
    const bool dark = (static_cast<int>(std::floor(yaw / 10)) + static_cast<int>(std::floor(pitch / 10))) % 2 == 0;
    const auto window = [](double a) { return std::abs(std::fmod(a + 360, 10) - 5) < 2; };
    // The tiles repeat; the light does not, so that a turned rig is not the same one.
    const auto light = static_cast<float>(0.8 + 0.15 * d.x - 0.1 * d.y + 0.08 * std::sin(3 * yaw * kDegree));
    const float level = light * ((dark ? 0.3F : 0.55F) + (window(yaw) && window(pitch) ? 0.2F : 0.0F));
    return {level, level, level};
  }
};

/// r / f as Taylor series by the angle, in powers 1, 2, ...
std::vector<double> series(const std::string& family) {
  if (family == "equisolid") return {1, 0, -1.0 / 24, 0, 1.0 / 1920, 0, -1.0 / 322560, 0, 1.0 / 92897280};
  if (family == "stereographic") return {1, 0, 1.0 / 12, 0, 1.0 / 120, 0, 17.0 / 20160, 0, 31.0 / 362880};
  if (family == "polynomial") return {1, 0, -0.025, 0, 0.004};  // a real lens: between equidistant and equisolid
  return {1};
}

struct Pair {
  std::string family, scene;
  double view_deg = 200;
  bool tilted = false;
};

Pair pair_of(int number) {
  const std::vector<std::string> families{"equidistant", "equisolid", "stereographic", "polynomial"};
  const std::vector<std::string> scenes{"town", "near", "room", "tiles", "town"};
  const std::vector<double> views{185, 190, 195, 200, 205, 210, 215, 220};
  const auto n = static_cast<std::size_t>(number);
  return {families[n % 4], scenes[n / 4 % 5], views[(3 * n + n / 8) % 8], n % 3 == 1};
}

double radius_of(const std::vector<double>& coefficients, double angle) {
  double sum = 0;
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    sum += coefficients[k] * std::pow(angle, static_cast<double>(k + 1));
  }
  return sum;
}

Calibration rig_of(const Pair& pair, int number) {
  Calibration rig;
  rig.name = "pair";
  std::mt19937_64 random(static_cast<std::uint64_t>(number) + 7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const std::vector<double> shape = series(pair.family);
  const double edge = pair.view_deg / 2 * kDegree, radius = 0.48 * kSide;
  std::vector<double> coefficients;
  for (const double k : shape) coefficients.push_back(k * radius / radius_of(shape, edge));
  for (int h = 0; h < 2; ++h) {
    HeadCalibration head = test::plain_head("cam" + std::to_string(h), kSide, kSide, 180.0 * h, 100);
    head.center_x += 2 * unit(random);
    head.center_y += 2 * unit(random);
    head.lens = EquidistantLens{coefficients};
    head.max_angle = edge;
    head.region = {0, 0, kSide, kSide, Region::Circle{head.center_x, head.center_y, radius - 0.5}};
    const double pitch = unit(random) + (pair.tilted ? 20 : 0) * (h == 0 ? 1 : -1), roll = 2 * unit(random);
    head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig({180.0 * h + unit(random), pitch, roll}));
    const double forward = pair.scene == "near" || pair.scene == "room" ? 0.012 : 0;
    head.position = {0, 0, h == 0 ? forward : -forward};
    head.vignetting = {head.center_x, head.center_y, radius, {-0.1 - 0.05 * unit(random), 0, 0}};
    head.gain.fill(1 + 0.05 * unit(random));
    rig.heads.push_back(head);
  }
  return rig;
}

test::RenderedRig rendered(const Pair& pair, const Calibration& rig, int number) {
  const test::RenderOptions options{PixelFormat::kRgb24, 1.0, static_cast<std::uint64_t>(number) + 1, 2};
  const auto town = hal::sim::town_square_scene(static_cast<std::uint64_t>(number) + 1);
  if (pair.scene == "tiles") return test::render_rig(rig, std::make_shared<Tiles>(), options);
  if (pair.scene == "near") {
    const test::Room room{test::Room::Shape::kBox, 3, {{1.2, 0.4, 0.2}, {-0.9, -0.7, 0.15}}};
    return test::render_rig_in(room, rig, town, options);
  }
  if (pair.scene == "room") return test::render_rig_in({test::Room::Shape::kBox, 4}, rig, town, options);
  return test::render_rig(rig, town, options);
}

std::vector<std::string> written(const test::RenderedRig& rig, const fs::path& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::vector<std::string> files;
  for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
    const HeadCalibration& head = rig.truth.heads[h];
    test::Picture picture(PixelFormat::kRgb24, head.width, head.height);
    std::ranges::copy(rig.bytes[h], picture.bytes.begin());
    files.push_back((folder / (head.name + ".png")).string());
    if (const Status done = test::write_png(files.back(), picture); !done) {
      std::fprintf(stderr, "%s\n", done.error().text().c_str());
      std::exit(1);
    }
  }
  return files;
}

struct Found {
  Calibration points, pictures;
  host::FirstCalibration first;
};

Result<Found> found_in(const std::vector<std::string>& files, const std::vector<std::string>& names) {
  const host::OwnProgress silent = [](double, const std::string&) {};
  Result<host::FirstCalibration> first = host::first_calibration(files, names, silent);
  if (!first) return fail(first.error());
  const Result<registration::Report> report = host::refined(*first, silent);
  Found found{first->calibration, report ? report->calibration : first->calibration, std::move(*first)};
  return found;
}

/// The largest difference of the found radius from the true one at these angles, percent.
double lens_error(const HeadCalibration& truth, const HeadCalibration& found, double angle) {
  const auto is = geometry::Lens::make(truth.lens), says = geometry::Lens::make(found.lens);
  const auto r = is ? is->radius(angle) : std::nullopt, s = says ? says->radius(angle) : std::nullopt;
  return r && s ? 100 * (*s / *r - 1) : 100;
}

void pairs(int count, const fs::path& folder) {
  std::printf(
      "  n family        scene  view tilt |   at 10    45    80   rim  worst known | rotation  up | known px     | "
      "notes\n");
  for (int n = 0; n < count; ++n) {
    const Pair pair = pair_of(n);
    const Calibration truth = rig_of(pair, n);
    const test::RenderedRig rig = rendered(pair, truth, n);
    std::printf("%3d %-13s %-6s %4.0f %4d | ", n, pair.family.c_str(), pair.scene.c_str(), pair.view_deg, pair.tilted);
    const auto found = found_in(written(rig, folder), {"cam0", "cam1"});
    if (!found) {
      std::printf("%s\n", found.error().text().c_str());
      continue;
    }
    if (found->pictures.heads.size() < 2) continue;
    const double edge = pair.view_deg / 2 * kDegree;
    const host::FoundLens& lens = found->first.lens;
    double worst = 0, worst_known = 0;
    const auto at = [&](double angle) {
      double most = 0;
      for (std::size_t h = 0; h < 2; ++h) {
        const double error = lens_error(truth.heads[h], found->pictures.heads[h], angle);
        if (std::abs(error) > std::abs(most)) most = error;
      }
      return most;
    };
    for (int k = 1; k <= 100; ++k) {
      const double angle = edge * 0.99 * k / 100, error = std::abs(at(angle));
      worst = std::max(worst, error);
      const double radius = geometry::Lens::make(truth.heads[0].lens)->radius(angle).value_or(0);
      if (lens.whole || (radius > lens.known.from_px && radius < lens.known.to_px))
        worst_known = std::max(worst_known, error);
    }
    const Eigen::Vector3d up = geometry::matrix_of(found->pictures.heads[0].R_head_rig) * Eigen::Vector3d(0, -1, 0),
                          is = geometry::matrix_of(truth.heads[0].R_head_rig) * Eigen::Vector3d(0, -1, 0);
    std::printf("%6.1f %5.1f %5.1f %5.1f %6.1f %5.1f | %7.2f %5.1f | %4.0f %4.0f %-13s %4.1f | %zu points, %s%s\n",
                at(10 * kDegree), at(45 * kDegree), at(80 * kDegree), at(0.98 * edge), worst, worst_known,
                test::rotation_error(truth, found->pictures).max_deg, std::acos(std::min(1.0, up.dot(is))) / kDegree,
                lens.known.from_px, lens.known.to_px, lens.family.c_str(), 100 * lens.unsure,
                found->first.points->size(), lens.whole ? "known" : "partly known", worst_known > 3 ? "  WRONG" : "");
    for (const std::string& note : found->first.notes) {
      if (note.starts_with("up is") || note.starts_with("which way")) std::printf("    %s\n", note.c_str());
    }
    std::fflush(stdout);
  }
}

Calibration hand_held(int number) {
  std::mt19937_64 random(static_cast<std::uint64_t>(number) + 99);
  std::uniform_real_distribution<double> unit(-1, 1);
  Calibration rig;
  rig.name = "hand";
  const double moved = 0.2 * (number % 5) / 4;
  const int pictures = 10 + number % 4;
  for (int h = 0; h < pictures; ++h) {
    HeadCalibration head = test::plain_head("p" + std::to_string(h), 960, 640, 0, 66);
    if (number % 2 == 1) {  // lenses that differ, as a zoom that was touched
      std::get<RectilinearLens>(head.lens).coefficients[0] *= 1 + 0.01 * unit(random);
    }
    head.R_head_rig = geometry::rows_of(
        geometry::to_R_head_rig({360.0 * h / pictures + 3 * unit(random), 4 * unit(random), 3 * unit(random)}));
    head.position = {moved * unit(random), moved * unit(random) / 2, moved * unit(random)};
    head.gain.fill(1 + 0.1 * unit(random));
    rig.heads.push_back(head);
  }
  return rig;
}

void hands(int count, const fs::path& folder) {
  std::printf("  n  moved near own | placed | points: rms   max deg | pictures: rms   max deg\n");
  for (int n = 0; n < count; ++n) {
    const Calibration truth = hand_held(n);
    const bool near = n % 4 >= 2;
    test::Room room{test::Room::Shape::kBox, 6};
    if (near) room.columns = {{1.5, 1.0, 0.2}, {-1.2, 1.4, 0.2}, {-1.0, -1.6, 0.2}};
    const auto town = hal::sim::town_square_scene(static_cast<std::uint64_t>(n) + 1);
    const test::RenderedRig rig =
        test::render_rig_in(room, truth, town, {PixelFormat::kRgb24, 1.0, static_cast<std::uint64_t>(n) + 1, 2});
    std::vector<std::string> names;
    for (const HeadCalibration& head : truth.heads) names.push_back(head.name);
    const auto found = found_in(written(rig, folder), names);
    std::printf("%3d %5.2f m %4d %3d | ", n, 0.2 * (n % 5) / 4, near, n % 2);
    if (!found) {
      std::printf("%s\n", found.error().text().c_str());
      continue;
    }
    Calibration placed = truth;
    placed.heads.clear();
    for (const std::size_t h : found->first.heads) placed.heads.push_back(truth.heads[h]);
    const auto points = test::rotation_error(placed, found->points),
               pictures = test::rotation_error(placed, found->pictures);
    std::printf("%2zu of %2zu | %8.3f %7.3f | %8.3f %7.3f\n", placed.heads.size(), truth.heads.size(), points.rms_deg,
                points.max_deg, pictures.rms_deg, pictures.max_deg);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  CLI::App app{"Lens, rotations and up from pictures alone, against the truth of rendered rigs"};
  int pairs = 0, hands = 0;
  std::string folder = "/tmp/nodal-from-pictures";
  app.add_option("--pairs", pairs, "pairs of fisheyes back to back (40 for all)");
  app.add_option("--hands", hands, "sets of pictures taken from the hand (20 for all)");
  app.add_option("--folder", folder, "where the rendered pictures go");
  CLI11_PARSE(app, argc, argv);
  if (pairs > 0) nodal::bench::pairs(pairs, folder);
  if (hands > 0) nodal::bench::hands(hands, folder);
  return 0;
}
