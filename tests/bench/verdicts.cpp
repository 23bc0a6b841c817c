// The word of seam checks against the truth, on 60 rendered rigs with planted faults. How far lines jump at a seam
// follows from the fault: the point of the scene that one head shows at a ray, and the one that the other shows there.
// Prints a line for each rig, and how often the word was wrong.
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>

#include "protocol/base/angles.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/offline/best_blend.h"
#include "stitch/offline/seam_check.h"
#include "stitch/parallel/workers.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::bench {
namespace {

using Eigen::Vector3d;
using offline::SeamCheck;
using offline::SeamVerdict;

constexpr const char* kFaults[] = {"none",       "head 1 px",   "head 4 px",   "head 15 px", "lens 1 %",     "lens 5 %",
                                   "parallax 3", "parallax 10", "parallax 30", "one stop",   "a third stop", "noise"};
constexpr int kKinds = 5;  // rigs

struct Planted {
  std::string fault;
  Calibration claimed;  ///< the calibration that the blend uses
  test::RenderedRig rig;
  test::Room room;
  bands::Grid raymap;
};

Eigen::Matrix3d matrix_of(const std::array<double, 9>& R) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.data());
}
Vector3d vector_of(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

/// Fisheyes about a point, or pictures from the hand.
Calibration rig_of(int kind) {
  if (kind == 0) return test::six_fisheyes(360);
  if (kind == 1) {
    Calibration pair = test::six_fisheyes(720, 200);
    pair.heads = {pair.heads[0], pair.heads[1]};
    return pair;
  }
  if (kind == 2) return test::three_rings(160, 75);
  Calibration ring;
  const int heads = kind == 3 ? 8 : 10;
  for (int h = 0; h < heads; ++h) {
    ring.heads.push_back(test::plain_head("p" + std::to_string(h), 480, 360, 360.0 * h / heads, kind == 3 ? 70 : 60));
  }
  return ring;
}

void turn(HeadCalibration& head, double degrees) {
  head.R_head_rig = geometry::rows_of(matrix_of(head.R_head_rig) * geometry::to_R_head_rig({degrees, 0, 0}));
}

void scale_lens(HeadCalibration& head, double by) {
  std::visit(
      [&](auto& lens) {
        if constexpr (requires { lens.coefficients; }) lens.coefficients[0] *= by;
      },
      head.lens);
}

Planted planted(int number) {
  const int kind = number % kKinds, fault = number / kKinds;
  Planted made;
  made.fault = kFaults[fault];
  Calibration truth = rig_of(kind);
  std::mt19937_64 random(static_cast<std::uint64_t>(number) + 5);
  std::uniform_real_distribution<double> unit(-1, 1);
  made.raymap = {1024, 512};
  made.room = {test::Room::Shape::kBox, 4};
  made.room.columns = {{1.5, 1.0, 0.2}, {-1.2, 1.4, 0.2}, {-1.0, -1.6, 0.2}, {1.4, -1.3, 0.2}};
  if (fault >= 6 && fault <= 8) {
    const double eye = std::array{0.03, 0.1, 0.3}[static_cast<std::size_t>(fault - 6)];
    for (HeadCalibration& head : truth.heads) {
      Vector3d away(unit(random), 0.3 * unit(random), unit(random));
      away *= eye / 2 / away.norm();
      head.position = {away.x(), away.y(), away.z()};
    }
  }
  const double noise = fault == 11 ? 4 : 1;
  made.rig = test::render_rig_in(made.room, truth, hal::sim::town_square_scene(static_cast<std::uint64_t>(number) + 1),
                                 {PixelFormat::kRgb24, noise, static_cast<std::uint64_t>(number) + 1, 2});
  made.claimed = truth;
  for (HeadCalibration& head : made.claimed.heads) head.position = {};
  const double pixel = 180.0 / made.raymap.height;
  if (fault == 1) turn(made.claimed.heads[0], pixel);
  if (fault == 2) turn(made.claimed.heads[0], 4 * pixel);
  if (fault == 3) turn(made.claimed.heads[0], 15 * pixel);
  if (fault == 4)
    for (HeadCalibration& head : made.claimed.heads) scale_lens(head, 1.01);
  if (fault == 5)
    for (HeadCalibration& head : made.claimed.heads) scale_lens(head, 1.05);
  if (fault == 9) made.claimed.heads[0].gain.fill(2);
  if (fault == 10) made.claimed.heads[0].gain.fill(std::exp2(1.0 / 3));
  return made;
}

/// The point of the scene that a head shows where the blend believes that it sees a ray.
std::optional<Vector3d> shown(const Planted& rig, const geometry::Head& claimed, const geometry::Head& is,
                              const Vector3d& ray) {
  const auto at = claimed.project(geometry::Ray::towards(ray));
  if (!at || !claimed.contains(*at)) return std::nullopt;
  const auto really = is.unproject(*at);
  if (!really) return std::nullopt;
  const Vector3d along = really->direction();
  const std::array<double, 3> from = is.calibration().position;
  return vector_of(from) + test::range_in(rig.room, from, {along.x(), along.y(), along.z()}) * along;
}

/// The jump that nine of ten places of the rig's worst seam stay below, px, from the truth: at the very places that
/// were looked at.
double true_jump(const Planted& rig, const std::vector<SeamCheck>& seams) {
  const auto claimed = geometry::make_heads(rig.claimed).value(), is = geometry::make_heads(rig.rig.truth).value();
  double worst = 0;
  for (const SeamCheck& seam : seams) {
    SeamCheck truth{seam.a, seam.b, 0, {}, 0};
    for (const offline::SeamPlace& place : seam.places) {
      const Vector3d ray = geometry::Ray::at(place.at).direction();
      const auto a = shown(rig, claimed[seam.a], is[seam.a], ray), b = shown(rig, claimed[seam.b], is[seam.b], ray);
      if (!a || !b) continue;
      const double angle = std::atan2(a->cross(*b).norm(), a->dot(*b));
      truth.places.push_back({place.at, angle / kPi * rig.raymap.height, true});
    }
    worst = std::max(worst, offline::usual_jump(truth));
  }
  return worst;
}

const char* word(SeamVerdict verdict) {
  return verdict == SeamVerdict::kGood ? "good" : verdict == SeamVerdict::kUsable ? "usable" : "look";
}

double largest_jump(const std::vector<SeamCheck>& seams) {
  double most = 0;
  for (const SeamCheck& seam : seams) most = std::max(most, offline::usual_jump(seam));
  return most;
}

double largest_bend(const std::vector<SeamCheck>& seams) {
  double most = 0;
  for (const SeamCheck& seam : seams) most = std::max(most, offline::usual_bend(seam));
  return most;
}

double largest_step(const std::vector<SeamCheck>& seams) {
  double most = 0;
  for (const SeamCheck& seam : seams) most = std::max(most, std::abs(seam.step_levels));
  return most;
}

/// How often the word was wrong.
struct Mistakes {
  int broken_called_good = 0, good_called_broken = 0;
  bool count(SeamVerdict said, bool is_good, bool is_broken) {
    const bool missed = is_broken && said == SeamVerdict::kGood, false_alarm = is_good && said == SeamVerdict::kLook;
    broken_called_good += missed;
    good_called_broken += false_alarm;
    return missed || false_alarm;
  }
  bool too_many(int good) const { return broken_called_good > 0 || 20 * good_called_broken > good; }
};

int run(int from, int to) {
  std::printf("  n rig fault         | true px | board: px, levels, word | best: px, bent px, levels, word\n");
  int broken = 0, good = 0;
  Mistakes of_board, of_best;
  for (int n = from; n < to; ++n) {
    const Planted rig = planted(n);
    const std::vector<ImageView> frames = rig.rig.frames();
    const auto board = offline::check_seams(rig.claimed, frames, rig.raymap, 0).value();
    auto blend = offline::BestBlend::make(
        rig.claimed, {"equirectangular", rig.raymap.width, rig.raymap.height, PixelFormat::kRgb24}, 0);
    std::vector<SeamCheck> best;
    if (const auto made = blend->blend(frames, &best); !made) {
      std::fprintf(stderr, "%s\n", made.error().text().c_str());
      return 1;
    }
    const double truth = true_jump(rig, board);
    const bool stepped = rig.fault == "one stop";
    const bool is_broken = truth > offline::kBrokenPx || stepped;
    const bool is_good = truth <= offline::kFinePx && !stepped && rig.fault != "a third stop";
    broken += is_broken;
    good += is_good;
    const bool wrong_board = of_board.count(offline::verdict_of(board), is_good, is_broken);
    const bool wrong_best = of_best.count(offline::verdict_of(best), is_good, is_broken);
    std::printf("%3d %3d %-13s | %7.1f | %6.1f %6.1f %-6s | %6.1f %6.1f %6.1f %-6s%s\n", n, n % kKinds,
                rig.fault.c_str(), truth, largest_jump(board), largest_step(board), word(offline::verdict_of(board)),
                largest_jump(best), largest_bend(best), largest_step(best), word(offline::verdict_of(best)),
                wrong_board || wrong_best ? "  WRONG" : "");
    std::fflush(stdout);
  }
  std::printf("%d broken, called good by board and best: %d, %d; %d good, called broken by them: %d, %d\n", broken,
              of_board.broken_called_good, of_best.broken_called_good, good, of_board.good_called_broken,
              of_best.good_called_broken);
  return of_board.too_many(good) || of_best.too_many(good);
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  CLI::App app("The word for a sphere (good, usable, look) against the truth, on rendered rigs with planted faults");
  int from = 0, to = 60;
  app.add_option("--from", from, "The first rig")->check(CLI::Range(0, 59));
  app.add_option("--to", to, "One past the last rig")->check(CLI::Range(1, 60));
  CLI11_PARSE(app, argc, argv);
  return nodal::bench::run(from, to);
}
