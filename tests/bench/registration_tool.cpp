// Tools for tests/bench/registration besides the compared programs: renders rigs with known truth, makes starting
// points away from it, and measures a result's distance from it.
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "stitch/blend/blend.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/media/image_file.h"
#include "stitch/table/table_compiler.h"
#include "tests/bench/registration_rig.h"
#include "tests/data/truth_rig.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"
#include "tests/reference/score.h"
#include "tests/support/rendered_rig.h"

namespace nodal::bench {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kToolWidth = 2048, kToolHeight = 1024;

[[noreturn]] void die(const std::string& why) {
  std::fprintf(stderr, "registration_tool: %s\n", why.c_str());
  std::exit(1);
}

template <class T>
T must(Result<T> result, const std::string& of) {
  if (!result) die(of + ": " + result.error().text());
  return std::move(*result);
}

std::string read_text(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) die("there is no " + file.string());
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  if (!out.flush()) die("cannot write " + file.string());
}

test_data::TruthRig truth_of(const fs::path& folder) {
  return must(test_data::read_truth_rig(read_text(folder / "rig_gt.json")), (folder / "rig_gt.json").string());
}

// A case's start: the truth plus the given errors.
struct Spoil {
  double least_deg = 2, most_deg = 5, focal_percent = 0, center_px = 0, kappa_percent = 0;
};

void spoil_lens(HeadCalibration& head, const Spoil& spoil, std::mt19937_64& random) {
  std::uniform_real_distribution<double> turn(0, 2 * std::acos(-1.0));
  std::bernoulli_distribution coin;
  const auto sign = [&] { return coin(random) ? 1.0 : -1.0; };
  const double around = turn(random);
  head.center_x += spoil.center_px * std::cos(around);
  head.center_y += spoil.center_px * std::sin(around);
  auto& lens = std::get<TsaiLens>(head.lens);
  lens.focal *= 1 + sign() * spoil.focal_percent / 100;
  const double kappa = 1 + sign() * spoil.kappa_percent / 100;
  lens.kappa1 *= kappa;
  lens.kappa2 *= kappa;
}

void make_prior(const fs::path& folder, const Spoil& spoil, std::uint64_t seed, const fs::path& out) {
  Calibration prior = test::turned(truth_of(folder).calibration, spoil.least_deg, spoil.most_deg, seed);
  prior.name = "prior";
  std::mt19937_64 random(seed + 1000);
  for (HeadCalibration& head : prior.heads) {
    spoil_lens(head, spoil, random);
    head.gain = {1, 1, 1};
    head.vignetting.coefficients = {};
    head.region = {0, 0, static_cast<double>(head.width), static_cast<double>(head.height), {}};
  }
  write_text(out, to_json(prior));
}

double stitch_psnr(const fs::path& folder, const Calibration& rig, const std::vector<std::string>& images) {
  const auto layout = must(geometry::make_layout("equirectangular", kToolWidth, kToolHeight), "layout");
  std::vector<DecodedImage> pictures;
  std::vector<ImageView> views;
  for (const std::string& image : images) {
    pictures.push_back(must(media::read_image(folder / image, PixelFormat::kRgb24), image));
  }
  for (const auto& picture : pictures) views.push_back(picture.view());
  table::TableOptions options;
  options.transition = Transition::kFeather;
  options.feather = 0.05;  // the heads share their nodal point exactly
  const auto table =
      must(table::compile_blend_table(rig, *layout, PixelFormat::kRgb24,
                                      std::vector<PixelFormat>(views.size(), PixelFormat::kRgb24), options),
           "blend table");
  test::Picture raymap(PixelFormat::kRgb24, kToolWidth, kToolHeight);
  blend::blend_rows(table, test::PreparedHeads(table, views).views(), blend::calibrated_tone(table),
                    raymap.mutable_view(), 0, kToolHeight);
  const test::Picture truth = must(test::read_png(folder / "gt_equirect_2048.png"), "the true sphere");
  return test::score(raymap.view(), truth.view(), *layout).psnr_db;
}

double picture_psnr(const fs::path& folder, const fs::path& raymap) {
  const auto layout = must(geometry::make_layout("equirectangular", kToolWidth, kToolHeight), "layout");
  const auto got = must(media::read_image(raymap, PixelFormat::kRgb24), raymap.string());
  const test::Picture truth = must(test::read_png(folder / "gt_equirect_2048.png"), "the true sphere");
  if (got.width != kToolWidth || got.height != kToolHeight) die(raymap.string() + " is not 2048x1024");
  return test::score(got.view(), truth.view(), *layout).psnr_db;
}

// Rotates the whole rig so that it is aligned with the truth.
Calibration aligned(const Calibration& truth, Calibration found, const std::vector<bool>& counted) {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t h = 0; h < found.heads.size(); ++h) {
    if (!counted[h]) continue;
    sum += Eigen::Map<const RowMajor>(found.heads[h].R_head_rig.data()).transpose() *
           Eigen::Map<const RowMajor>(truth.heads[h].R_head_rig.data());
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d common = svd.matrixU() * svd.matrixV().transpose();
  for (HeadCalibration& head : found.heads) {
    const Eigen::Matrix3d R = Eigen::Map<const RowMajor>(head.R_head_rig.data()) * common;
    Eigen::Map<RowMajor>(head.R_head_rig.data()) = R;
  }
  return found;
}

// Replaces one head's picture by sky: a slow gradient with the other pictures' noise.
void make_sky(const fs::path& folder, const fs::path& out, int head, std::uint64_t seed) {
  fs::remove_all(out);
  fs::create_directories(out);
  fs::copy(folder, out, fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  const fs::path file = out / truth_of(folder).images[static_cast<std::size_t>(head)];
  test::Picture picture = must(test::read_png(file), file.string());
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1.5);
  for (std::size_t k = 0; k < picture.bytes.size(); ++k) {
    const double y = static_cast<double>(k / 3 / static_cast<std::size_t>(picture.width)) / picture.height;
    const double shade[3] = {120 + 30 * y, 150 + 25 * y, 205 + 10 * y};
    picture.bytes[k] = static_cast<std::uint8_t>(std::clamp(std::lround(shade[k % 3] + noise(random)), 0L, 255L));
  }
  fs::remove(file);
  if (const Status written = test::write_png(file, picture); !written) die(written.error().text());
}

void score(const fs::path& folder, const fs::path& calibration, int without, bool stitch, const fs::path& align) {
  const test_data::TruthRig truth = truth_of(folder);
  const Calibration found = must(parse_calibration(read_text(calibration)), calibration.string());
  std::vector<bool> counted(truth.images.size(), true);
  if (without >= 0) counted[static_cast<std::size_t>(without)] = false;
  const test::RotationError error = test::rotation_error(truth.calibration, found, counted);
  double squares = 0, count = 0;
  for (std::size_t h = 0; h < counted.size(); ++h) {
    const auto* lens = std::get_if<TsaiLens>(&found.heads[h].lens);
    if (!counted[h] || lens == nullptr) continue;
    squares += std::pow(100 * (lens->focal / std::get<TsaiLens>(truth.calibration.heads[h].lens).focal - 1), 2);
    ++count;
  }
  json line = {{"rotation_rms_deg", error.rms_deg}, {"rotation_max_deg", error.max_deg}};
  if (count > 0) line["focal_rms_percent"] = std::sqrt(squares / count);
  const Calibration upright = aligned(truth.calibration, found, counted);
  if (stitch) line["psnr_db"] = stitch_psnr(folder, upright, truth.images);
  if (!align.empty()) write_text(align, to_json(upright));
  std::printf("%s\n", line.dump().c_str());
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  using namespace nodal::bench;
  CLI::App app{"Rigs with a known truth, starting points away from it, and how far a result is from it"};
  app.require_subcommand(1);
  std::string folder, out, calibration, picture;
  Spoil spoil;
  std::uint64_t seed = 1;
  int without = -1, head = 0;
  std::string align;
  bool stitch = false;
  CLI::App* prior = app.add_subcommand("prior", "the truth, spoilt");
  prior->add_option("FOLDER", folder)->required();
  prior->add_option("OUT", out)->required();
  prior->add_option("--seed", seed);
  prior->add_option("--least-deg", spoil.least_deg);
  prior->add_option("--most-deg", spoil.most_deg);
  prior->add_option("--focal-percent", spoil.focal_percent);
  prior->add_option("--center-px", spoil.center_px);
  prior->add_option("--kappa-percent", spoil.kappa_percent);
  CLI::App* scores = app.add_subcommand("score", "how far a calibration is from the truth");
  scores->add_option("FOLDER", folder)->required();
  scores->add_option("CALIBRATION", calibration)->required();
  scores->add_option("--without", without, "this head does not count");
  scores->add_flag("--stitch", stitch, "blend with it and compare with the true sphere");
  scores->add_option("--aligned", align, "write it, turned as a whole onto the truth");
  CLI::App* render = app.add_subcommand("render", "a rig with a known truth");
  render->add_option("OUT", out)->required();
  render->add_option("--seed", seed);
  CLI::App* sky = app.add_subcommand("sky", "a copy of which one head sees only sky");
  sky->add_option("FOLDER", folder)->required();
  sky->add_option("OUT", out)->required();
  sky->add_option("--head", head);
  sky->add_option("--seed", seed);
  CLI::App* psnr = app.add_subcommand("psnr", "of a picture of the sphere");
  psnr->add_option("FOLDER", folder)->required();
  psnr->add_option("PICTURE", picture)->required();
  CLI11_PARSE(app, argc, argv);
  if (*prior) make_prior(folder, spoil, seed, out);
  if (*scores) score(folder, calibration, without, stitch, align);
  if (*render) render_set(out, seed);
  if (*sky) make_sky(folder, out, head, seed);
  if (*psnr) std::printf("{\"psnr_db\": %.4f}\n", picture_psnr(folder, picture));
  return 0;
}
