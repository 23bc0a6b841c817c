#include "tests/bench/fisheye_pairs.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <random>

#include "host_tool/input/nominal_rig.h"
#include "host_tool/input/own_pictures.h"
#include "host_tool/input/pictures.h"
#include "protocol/base/angles.h"
#include "stitch/autocalibration/matches.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/geometry/rotation.h"
#include "tests/reference/png_file.h"
#include "tests/support/rigs.h"

namespace nodal::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::array<double, 3> kAskedDeg{10, 45, 80};

/// r / f as a Taylor series by the angle, in powers 1, 2, ...
std::vector<double> series_of(const std::string& family) {
  if (family == "equisolid") return {1, 0, -1.0 / 24, 0, 1.0 / 1920, 0, -1.0 / 322560, 0, 1.0 / 92897280};
  if (family == "stereographic") return {1, 0, 1.0 / 12, 0, 1.0 / 120, 0, 17.0 / 20160, 0, 31.0 / 362880};
  if (family == "polynomial") return {1, 0, -0.025, 0, 0.004};
  return {1};
}

double series_at(const std::vector<double>& coefficients, double angle) {
  double sum = 0;
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    sum += coefficients[k] * std::pow(angle, static_cast<double>(k + 1));
  }
  return sum;
}

double edge_of(const FisheyePair& pair) { return pair.view_deg / 2 * kRadiansPerDegree; }

/// The error of the radius at an angle, percent: of the head of which it is larger. 100 if the lens does not reach so
/// far.
double lens_error(const Calibration& truth, const Calibration& found, double angle) {
  double most = 0;
  for (std::size_t h = 0; h < truth.heads.size(); ++h) {
    const auto is = geometry::Lens::make(truth.heads[h].lens), says = geometry::Lens::make(found.heads[h].lens);
    const auto r = is ? is->radius(angle) : std::nullopt, s = says ? says->radius(angle) : std::nullopt;
    const double error = r && s ? 100 * (*s / *r - 1) : 100;
    if (std::abs(error) > std::abs(most)) most = error;
  }
  return most;
}

Eigen::Vector3d up_in(const HeadCalibration& head) {
  return geometry::matrix_of(head.R_head_rig) * Eigen::Vector3d(0, -1, 0);
}

/// `known`: whether the result says that it knows the lens at this distance from the axis, px.
PairErrors errors_of(const FisheyePair& pair, const Calibration& truth, const Calibration& found,
                     const std::function<bool(double)>& known) {
  PairErrors errors;
  for (std::size_t k = 0; k < kAskedDeg.size(); ++k) {
    errors.lens[k] = lens_error(truth, found, kAskedDeg[k] * kRadiansPerDegree);
  }
  errors.lens.back() = lens_error(truth, found, 0.98 * edge_of(pair));
  const auto lens = geometry::Lens::make(truth.heads.front().lens);
  for (int k = 1; k <= 100; ++k) {
    const double angle = edge_of(pair) * 0.99 * k / 100, error = std::abs(lens_error(truth, found, angle));
    errors.worst = std::max(errors.worst, error);
    if (known(lens->radius(angle).value_or(0))) errors.worst_known = std::max(errors.worst_known, error);
  }
  errors.rotation_deg = test::rotation_error(truth, found).max_deg;
  const double cosine = up_in(found.heads.front()).dot(up_in(truth.heads.front()));
  errors.up_deg = std::acos(std::clamp(cosine, -1.0, 1.0)) * kDegreesPerRadian;
  return errors;
}

}  // namespace

FisheyePair pair_of(int number) {
  const std::array<std::string, 4> families{"equidistant", "equisolid", "stereographic", "polynomial"};
  const std::array<std::string, 5> scenes{"town", "near", "room", "tiles", "town"};
  const std::array<double, 8> views{185, 190, 195, 200, 205, 210, 215, 220};
  const auto n = static_cast<std::size_t>(number);
  return {families[n % 4], scenes[n / 4 % 5], views[(3 * n + n / 8) % 8], n % 3 == 1};
}

Calibration true_pair(const FisheyePair& pair, int seed) {
  Calibration rig;
  rig.name = "pair";
  std::mt19937_64 random(static_cast<std::uint64_t>(seed) + 7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const std::vector<double> shape = series_of(pair.family);
  const double radius = 0.48 * pair.side;
  std::vector<double> coefficients;
  for (const double k : shape) coefficients.push_back(k * radius / series_at(shape, edge_of(pair)));
  for (int h = 0; h < 2; ++h) {
    HeadCalibration head = test::plain_head("cam" + std::to_string(h), pair.side, pair.side, 180.0 * h, 100);
    head.center_x += 2 * unit(random);
    head.center_y += 2 * unit(random);
    head.lens = EquidistantLens{coefficients};
    head.max_angle = edge_of(pair);
    const auto side = static_cast<double>(pair.side);
    head.region = {0, 0, side, side, Region::Circle{head.center_x, head.center_y, radius - 0.5}};
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

test::RenderedRig rendered_pair(const FisheyePair& pair, const Calibration& truth, int seed) {
  const test::RenderOptions options{PixelFormat::kRgb24, 1.0, static_cast<std::uint64_t>(seed) + 1, 2};
  const auto town = hal::sim::town_square_scene(static_cast<std::uint64_t>(seed) + 1);
  if (pair.scene == "tiles") return test::render_rig(truth, test::tiles_scene(), options);
  if (pair.scene == "near") {
    const test::Room room{test::Room::Shape::kBox, 3, {{1.2, 0.4, 0.2}, {-0.9, -0.7, 0.15}}};
    return test::render_rig_in(room, truth, town, options);
  }
  if (pair.scene == "room") return test::render_rig_in({test::Room::Shape::kBox, 4}, truth, town, options);
  return test::render_rig(truth, town, options);
}

PairVerdict judged_alone(const FisheyePair& pair, const Calibration& truth, const std::vector<std::string>& files) {
  const host::OwnProgress silent = [](double, const std::string&) {};
  PairVerdict verdict;
  Result<host::RigPictures> rig = host::own_pictures(files);
  const auto placed = rig ? host::calibrate_by_pictures(*rig, {}, silent) : fail(rig.error());
  if (!placed) {
    verdict.refused = placed.error().message;
    return verdict;
  }
  if (placed->size() < 2) {
    verdict.refused = "one head is left out";
    return verdict;
  }
  const Result<registration::Report> report = host::refined(*rig, silent);
  const host::FoundLens& lens = rig->match->lens;
  const auto known = [&](double px) { return lens.whole || (px > lens.known.from_px && px < lens.known.to_px); };
  verdict.errors = errors_of(pair, truth, report ? report->calibration : rig->calibration, known);
  verdict.points = rig->match->points->size();
  verdict.known_from_px = lens.known.from_px;
  verdict.known_to_px = lens.known.to_px;
  verdict.whole = lens.whole;
  verdict.family = lens.family;
  verdict.unsure_percent = lens.may_be_wrong_percent();
  verdict.notes = rig->notes;
  return verdict;
}

PairVerdict judged_nominal(const FisheyePair& pair, const Calibration& truth, const std::vector<std::string>& files,
                           const NominalAsked& asked) {
  PairVerdict verdict;
  std::vector<host::HeadPicture> pictures(files.begin(), files.end());
  const Status decoded = host::decode_all(pictures);
  registration::FrameSet frames;
  for (const host::HeadPicture& picture : pictures) {
    if (decoded) frames.push_back(picture.pixels().view());
  }
  host::Nominal nominal;
  nominal.heads = 2;
  nominal.view_deg = pair.view_deg;
  if (asked.family && pair.family != "polynomial") nominal.lens = pair.family;
  const Result<Calibration> prior =
      decoded ? host::nominal_rig(nominal, frames) : Result<Calibration>(fail(decoded.error()));
  if (!prior) {
    verdict.refused = prior.error().message;
    return verdict;
  }
  registration::Options options;
  options.lens_far_off = true;
  options.lens_kind_assumed = !asked.family || pair.family == "polynomial";
  options.free = asked.lenses ? registration::Free::kLens : registration::Free::kRotations;
  const Result<registration::Report> report = registration::register_heads(*prior, {frames}, options);
  if (!report) {
    verdict.refused = report.error().message;
    return verdict;
  }
  const auto& lens = report->lens;
  verdict.whole = !lens;
  if (lens) {
    verdict.known_from_px = lens->from_px;
    verdict.known_to_px = lens->to_px;
    verdict.unsure_percent = std::ceil(100 * lens->unsure);
  }
  const auto known = [&](double px) { return !lens || (px > lens->from_px && px < lens->to_px); };
  verdict.errors = errors_of(pair, truth, report->calibration, known);
  verdict.notes = report->warnings;
  return verdict;
}

Result<std::vector<std::string>> written(const test::RenderedRig& rig, const fs::path& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::vector<std::string> files;
  for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
    const HeadCalibration& head = rig.truth.heads[h];
    test::Picture picture(PixelFormat::kRgb24, head.width, head.height);
    std::ranges::copy(rig.bytes[h], picture.bytes.begin());
    files.push_back((folder / (head.name + ".png")).string());
    if (const Status done = test::write_png(files.back(), picture); !done) return fail(done.error());
  }
  return files;
}

}  // namespace nodal::bench
