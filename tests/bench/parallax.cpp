// Heads that do not share one nodal point, in a room with people: the raymap against what the rig's nodal point sees.
//   build/release/bin/bench_parallax [DIR]    a table; DIR gets the raymaps as PNG
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "stitch/geometry/rotation.h"
#include "stitch/media/png_writer.h"
#include "stitch/offline/offline_blend.h"
#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"

namespace nodal {
namespace {

constexpr int kWidth = 1024, kHeight = 512;
constexpr double kNearSeams = 2;  // degrees

struct Picture {
  std::vector<std::uint8_t> grey;
  double at(int x, int y) const { return grey[static_cast<std::size_t>(y * kWidth + (x + kWidth) % kWidth)]; }
};

const geometry::RaymapLayout& layout() {
  static const auto made = geometry::make_layout("equirectangular", kWidth, kHeight).value();
  return *made;
}

/// What the nodal point sees, with 4 x 4 rays a pixel.
Picture truth_of(const hal::sim::ScenePtr& scene) {
  constexpr int kFine = 4;
  Picture truth;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      double sum = 0;
      for (int k = 0; k < kFine * kFine; ++k) {
        const Eigen::Vector3d d =
            layout().ray(x + (k % kFine + 0.5) / kFine, y + (k / kFine + 0.5) / kFine)->direction();
        const hal::sim::Light light = scene->light({d.x(), d.y(), d.z()}, 6.283 / kWidth / kFine);
        sum += std::clamp(0.299 * light.r + 0.587 * light.g + 0.114 * light.b, 0.0, 1.0);
      }
      truth.grey.push_back(static_cast<std::uint8_t>(std::lround(255 * sum / (kFine * kFine))));
    }
  }
  return truth;
}

/// Whether two heads' axes are about equally far from the ray.
bool near_a_seam(const Calibration& rig, const Eigen::Vector3d& ray) {
  Eigen::Vector3d best(0, 0, 0), second(0, 0, 0);
  for (const HeadCalibration& head : rig.heads) {
    const Eigen::Vector3d axis = geometry::matrix_of(head.R_head_rig).row(2).transpose();
    if (axis.dot(ray) > best.dot(ray)) second = std::exchange(best, axis);
    else if (axis.dot(ray) > second.dot(ray)) second = axis;
  }
  return std::abs(std::asin((best - second).normalized().dot(ray))) * 57.29578 < kNearSeams;
}

struct Score {
  double all_db = 0, seam_db = 0;
  double detail = 0;  ///< of the raymap's horizontal differences near the seams, relative to the truth's
};

Score score(const Picture& raymap, const Picture& truth, const Calibration& rig) {
  double all = 0, all_weight = 0, seam = 0, seam_weight = 0, steps = 0, true_steps = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Eigen::Vector3d ray = layout().ray(x + 0.5, y + 0.5)->direction();
      const double weight = std::hypot(ray.x(), ray.z());  // of the pixel's solid angle
      const double off = std::pow(raymap.at(x, y) - truth.at(x, y), 2);
      all += weight * off;
      all_weight += weight;
      if (!near_a_seam(rig, ray)) continue;
      seam += weight * off;
      seam_weight += weight;
      steps += weight * std::pow(raymap.at(x + 1, y) - raymap.at(x, y), 2);
      true_steps += weight * std::pow(truth.at(x + 1, y) - truth.at(x, y), 2);
    }
  }
  const auto db = [](double square) { return 10 * std::log10(255.0 * 255.0 / square); };
  return {db(all / all_weight), db(seam / seam_weight), std::sqrt(steps / true_steps)};
}

void save(const Picture& picture, const std::string& folder, const std::string& name) {
  if (folder.empty()) return;
  const auto png =
      media::png_file({kWidth, kHeight, 1, 8, picture.grey}, {media::PngNotes::Numbers::kLinear, 0, name, {}, 6});
  if (!png) return;
  std::ofstream file(std::filesystem::path(folder) / (name + ".png"), std::ios::binary);
  file.write(reinterpret_cast<const char*>(png->data()), static_cast<std::streamsize>(png->size()));
}

int run(const std::string& folder) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  test::Room room{test::Room::Shape::kBox, 4, {}};
  for (int k = 0; k < 8; ++k) {  // people at 1.5 m, every second one on a seam
    const double yaw = k * 0.785398;
    room.columns.push_back({1.5 * std::sin(yaw), 1.5 * std::cos(yaw), 0.25});
  }
  const Picture truth = truth_of(test::what_a_rig_sees(room, {}, town));
  save(truth, folder, "truth");
  const Calibration one_point = test::six_fisheyes(480);
  std::printf("%-6s %-9s %-10s %9s %9s %8s\n", "off", "blend", "distance", "all dB", "seams dB", "detail");
  for (const double off : {0.0, 0.03, 0.1, 0.3}) {
    const Calibration rig = test::spread_out(one_point, off);
    const test::RenderedRig seen = test::render_rig_in(room, rig, town, {PixelFormat::kGrey8, 1.0, 5, 3});
    registration::Options sought;
    sought.distance = true;
    Calibration fitted = rig;
    if (off > 0) {
      const auto found = registration::register_heads(rig, {seen.frames()}, sought);
      // At 0.3 m nothing but a wall agrees at any one distance: the middle of the room is given.
      fitted.distance = found ? found->calibration.distance : 3;
      if (!found) std::printf("%.2f m: not registered, 3 m are given\n", off);
    }
    const std::vector<std::pair<const char*, table::Transition>> blends{{"feather", table::Transition::kFeather},
                                                                        {"seam", table::Transition::kSeam},
                                                                        {"two-band", table::Transition::kTwoBand}};
    for (const auto& [name, transition] : blends) {
      for (const Calibration* calibration : {&rig, static_cast<const Calibration*>(&fitted)}) {
        if (calibration == &fitted && fitted.distance == 0) continue;
        table::TableOptions options;
        options.transition = transition;
        options.cover = false;
        const table::RaymapSpec spec{"equirectangular", kWidth, kHeight, PixelFormat::kGrey8};
        const auto blend = offline::OfflineBlend::make(*calibration, spec, options, PixelFormat::kGrey8, 0, {});
        if (!blend) return std::printf("%s\n", blend.error().text().c_str()), 1;
        const Picture raymap{blend->blend(seen.frames()).value().bytes};
        const Score got = score(raymap, truth, rig);
        char distance[16] = "infinity";
        if (calibration->distance > 0) std::snprintf(distance, sizeof distance, "%.2f m", calibration->distance);
        std::printf("%.2f m %-9s %-10s %9.2f %9.2f %8.3f\n", off, name, distance, got.all_db, got.seam_db, got.detail);
        char file[64];
        std::snprintf(file, sizeof file, "%s-%.2f-%s", name, off, calibration->distance > 0 ? "near" : "far");
        save(raymap, folder, file);
      }
    }
  }
  return 0;
}

}  // namespace
}  // namespace nodal

int main(int argc, char** argv) { return nodal::run(argc > 1 ? argv[1] : ""); }
