// Films of the reference rigs for tests/bench/films, what other programs need to stitch them, and the blend alone.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "host_tool/film/film_blend.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/rotation.h"
#include "tests/bench/workloads.h"

namespace nodal::bench {
namespace {

constexpr int kOwnFrames = 8;  // frames that are rendered; longer films go back and forth through them
constexpr double kTurn = 0.3 * std::numbers::pi / 180;  // rotation of the rig from frame to frame

/// Two fisheyes of 200 degrees, back to back, into 5760x2880 I420: what 360-degree cameras have.
Workload two() {
  Workload work{"two", {}, {"equirectangular", 5760, 2880, PixelFormat::kI420}};
  work.rig.name = work.name;
  for (int h = 0; h < 2; ++h) {
    HeadCalibration head;
    head.name = "head" + std::to_string(h);
    head.width = head.height = 2880;
    head.center_x = head.center_y = 1440;
    head.lens = EquidistantLens{{1440 / (100 * std::numbers::pi / 180)}};
    head.max_angle = 99.5 * std::numbers::pi / 180;
    head.region = {0, 0, 2880, 2880, {}};
    head.vignetting = {1440, 1440, 1440, {}};
    head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig({180.0 * h, 0, 0}));
    work.rig.heads.push_back(head);
  }
  return work;
}

Workload workload(const std::string& name) { return name == "r10" ? r10() : name == "r8" ? r8() : two(); }

/// The rig after some frames' turn.
Calibration turned(Calibration rig, int frame) {
  const Eigen::Matrix3d turn = geometry::rotation_about(kTurn * frame * Eigen::Vector3d(0.2, 0.95, 0.1));
  for (HeadCalibration& head : rig.heads) {
    head.R_head_rig = geometry::rows_of(geometry::matrix_of(head.R_head_rig) * turn);
  }
  return rig;
}

void write_films(const Workload& work, const std::string& folder, int frames) {
  std::vector<std::vector<std::vector<std::uint8_t>>> pictures;  // frame, head
  for (int f = 0; f < std::min(frames, kOwnFrames); ++f) {
    pictures.push_back(film(turned(work.rig, f), PixelFormat::kI420, 1).memory);
    std::fprintf(stderr, "\rrendering %s: %d of %d", work.name.c_str(), f + 1, std::min(frames, kOwnFrames));
  }
  std::fprintf(stderr, "\n");
  const int turn = 2 * static_cast<int>(pictures.size()) - 2;
  for (std::size_t h = 0; h < work.rig.heads.size(); ++h) {
    std::ofstream raw(folder + "/" + work.rig.heads[h].name + ".yuv", std::ios::binary);
    for (int f = 0; f < frames; ++f) {
      const int at = turn > 0 ? f % turn : 0;
      const auto& bytes = pictures[static_cast<std::size_t>(std::min(at, turn - at))][h];
      raw.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    }
  }
  std::ofstream(folder + "/rig.json") << to_json(work.rig);
}

/// A head's place of every ray of the raymap, for FFmpeg's remap, and how much of it is laid over the heads before, for
/// maskedmerge: a feather by the distance to the edge.
void write_maps(const Workload& work, const std::string& folder) {
  const std::vector<geometry::Head> heads = geometry::make_heads(work.rig).value();
  const int width = work.raymap.width, height = work.raymap.height;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::vector<double> sum(pixels, 0.0);
  for (const geometry::Head& head : heads) {
    std::vector<std::uint8_t> x(2 * pixels, 0xff), y(2 * pixels, 0xff), mask(pixels, 0);
    for (std::size_t k = 0; k < pixels; ++k) {
      const double theta =
          2 * std::numbers::pi * ((static_cast<double>(k % static_cast<std::size_t>(width)) + 0.5) / width - 0.5);
      const double phi =
          std::numbers::pi * ((static_cast<double>(k / static_cast<std::size_t>(width)) + 0.5) / height - 0.5);
      const auto at = head.project(geometry::Ray::at(geometry::Angles{theta, phi}));
      if (!at || !head.contains(*at)) continue;
      const double weight = 1e-6 + head.distance_to_edge(*at);
      sum[k] += weight;
      mask[k] = static_cast<std::uint8_t>(std::lround(255 * weight / sum[k]));
      const auto put = [&](std::vector<std::uint8_t>& into, double place) {
        const auto value = static_cast<unsigned>(std::clamp(place, 0.0, 65534.0));
        into[2 * k] = static_cast<std::uint8_t>(value >> 8);
        into[2 * k + 1] = static_cast<std::uint8_t>(value & 0xff);
      };
      put(x, at->x);
      put(y, at->y);
    }
    const auto pgm = [&](const char* kind, int largest, const std::vector<std::uint8_t>& bytes) {
      std::ofstream file(folder + "/" + head.name() + kind, std::ios::binary);
      file << "P5 " << width << " " << height << " " << largest << "\n";
      file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    };
    pgm("-x.pgm", 65535, x);
    pgm("-y.pgm", 65535, y);
    pgm("-mask.pgm", 255, mask);
  }
}

double processor() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Processor seconds a frame of the blend alone, as `nodal stitch` blends films: pictures and raymap in memory. The
/// lower quartile of many.
double blend_seconds(const Workload& work, int threads) {
  film::FilmPlan plan;
  plan.calibration = work.rig;
  plan.raymap.layout = work.raymap.layout;
  plan.raymap.width = work.raymap.width;
  plan.raymap.height = work.raymap.height;
  plan.raymap.format = PixelFormat::kI420;
  for (const HeadCalibration& head : work.rig.heads) {
    plan.heads.emplace_back();
    plan.heads.back().name = head.name;
    plan.heads.back().film.format = PixelFormat::kI420;
  }
  auto blend = film::FilmBlend::make(plan, threads);
  if (!blend) {
    std::fprintf(stderr, "%s\n", blend.error().text().c_str());
    std::exit(1);
  }
  const FilmedSet set = film(work.rig, PixelFormat::kI420, 1);
  std::vector<std::uint8_t> raymap(packed_size(PixelFormat::kI420, work.raymap.width, work.raymap.height));
  std::vector<double> took;
  for (int k = 0; k < 40; ++k) {
    const double before = processor();
    blend->blend(set.heads, raymap.data());
    took.push_back(processor() - before);
  }
  std::ranges::sort(took);
  return took[took.size() / 4];
}

int main_of(int argc, char** argv) {
  CLI::App app{"Films of a reference rig, or the blend of them alone"};
  std::string name, folder;
  int frames = 60, threads = 1;
  app.add_option("RIG", name)->required()->check(CLI::IsMember({"r10", "r8", "two"}));
  app.add_option("--write", folder, "Writes rig.json, raw I420 films, and maps for FFmpeg, into this folder");
  app.add_option("--frames", frames)->check(CLI::Range(1, 10000));
  app.add_option("--threads", threads)->check(CLI::Range(1, 64));
  CLI11_PARSE(app, argc, argv);
  const Workload work = workload(name);
  if (!folder.empty()) {
    write_films(work, folder, frames);
    write_maps(work, folder);
    return 0;
  }
  std::printf("{\"rig\":\"%s\",\"threads\":%d,\"blend_ms\":%.3f}\n", name.c_str(), threads,
              1000 * blend_seconds(work, threads));
  return 0;
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) { return nodal::bench::main_of(argc, argv); }
