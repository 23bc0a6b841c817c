// Rigs of which nothing is known but their pictures, against the truth: pairs of fisheyes back to back, beside a data
// sheet's calibration, and sets of pictures taken from the hand, beside Hugin. Prints tables.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>

#include "host_tool/input/own_pictures.h"
#include "tests/bench/fisheye_pairs.h"
#include "tests/bench/hand_held.h"

namespace nodal::bench {
namespace {

namespace fs = std::filesystem;

constexpr double kHandViewDeg = 66;

struct Range {
  int from = 0, to = 0;
};

std::vector<std::string> written_or_exit(const test::RenderedRig& rig, const fs::path& folder) {
  auto files = written(rig, folder);
  if (files) return *std::move(files);
  std::fprintf(stderr, "%s\n", files.error().text().c_str());
  std::exit(1);
}

void print_errors(const PairErrors& e) {
  std::printf("%6.1f %5.1f %5.1f %5.1f %5.1f | %5.2f %5.1f", e.lens[0], e.lens[1], e.lens[2], e.lens[3], e.worst,
              e.rotation_deg, e.up_deg);
}

/// Whether the lens is wrong by more than what is said about it.
bool is_wrong(const PairVerdict& verdict) {
  const PairErrors& e = verdict.errors;
  return e.worst_known > 3 || (!verdict.whole && e.worst > std::max(3.0, verdict.unsure_percent));
}

void print_nominal(const PairVerdict& verdict, const char* what) {
  std::printf("    %-28s | ", what);
  if (verdict.refused.empty()) {
    print_errors(verdict.errors);
    if (verdict.whole) {
      std::printf(" | everywhere, %.1f", verdict.errors.worst_known);
    } else {
      std::printf(" | %.0f to %.0f, %.1f; else %.0f", verdict.known_from_px, verdict.known_to_px,
                  verdict.errors.worst_known, verdict.unsure_percent);
    }
    std::printf("%s\n", is_wrong(verdict) ? "  WRONG" : "");
  } else {
    std::printf("%s\n", verdict.refused.c_str());
  }
  for (const std::string& warning : verdict.notes) std::printf("      warning: %s\n", warning.c_str());
}

void pairs(Range range, const fs::path& folder, bool nominal) {
  std::printf(
      "  n family        scene  view tilt | at 10    45    80   rim worst | turned   up | known px, %% off there; else "
      "family, said %%\n");
  int placed = 0, unknown_to_it = 0;
  for (int n = range.from; n < range.to; ++n) {
    const FisheyePair pair = pair_of(n);
    const Calibration truth = true_pair(pair, n);
    const auto files = written_or_exit(rendered_pair(pair, truth, n), folder);
    std::printf("%3d %-13s %-6s %4.0f %4d | ", n, pair.family.c_str(), pair.scene.c_str(), pair.view_deg, pair.tilted);
    const PairVerdict alone = judged_alone(pair, truth, files);
    if (alone.refused.empty()) {
      ++placed;
      const PairErrors& e = alone.errors;
      const bool wrong = is_wrong(alone);
      unknown_to_it += wrong ? 1 : 0;
      print_errors(e);
      if (alone.whole) {
        std::printf(" | everywhere, %.1f", e.worst_known);
      } else {
        std::printf(" | %.0f to %.0f, %.1f; %s, %.0f", alone.known_from_px, alone.known_to_px, e.worst_known,
                    alone.family.c_str(), alone.unsure_percent);
      }
      std::printf("; %zu points%s\n", alone.points, wrong ? "  WRONG" : "");
      for (const std::string& note : alone.notes) {
        if (note.starts_with("up is") || note.starts_with("which way")) std::printf("    %s\n", note.c_str());
      }
    } else {
      std::printf("%s\n", alone.refused.c_str());
    }
    if (nominal) {
      print_nominal(judged_nominal(pair, truth, files, {}), "--nominal");
      print_nominal(judged_nominal(pair, truth, files, {.lenses = true}), "--nominal --free lens");
      print_nominal(judged_nominal(pair, truth, files, {.family = true}), "--nominal --lens FAMILY");
      print_nominal(judged_nominal(pair, truth, files, {.family = true, .lenses = true}), "the same, --free lens");
    }
    std::fflush(stdout);
  }
  std::printf("%d of %d placed; %d of them off by more than 3 %% and than what is said\n", placed,
              range.to - range.from, unknown_to_it);
}

Placed in_order(const Calibration& calibration, const std::vector<std::size_t>& heads, std::size_t pictures) {
  Placed placed(pictures);
  for (std::size_t n = 0; n < heads.size(); ++n) placed[heads[n]] = calibration.heads[n];
  return placed;
}

void print_hand(const char* who, const Placed& placed, const Placed& other, const Calibration& truth,
                const std::vector<KeptPoint>& points) {
  std::vector<bool> counted;
  for (std::size_t h = 0; h < placed.size(); ++h) counted.push_back(placed[h] && other[h]);
  const HandErrors errors = errors_of(truth, placed, counted, points);
  std::printf(" | %s%2ld %6.3f %6.3f %6.3f", who,
              std::ranges::count_if(placed, [](const auto& h) { return h.has_value(); }), errors.rms_deg,
              errors.max_deg, errors.kept_deg);
}

/// Each program: pictures placed; of those that both placed, rotations rms and at most, and kept points, degrees.
void hands(Range range, const fs::path& folder, bool beside_hugin) {
  std::printf("  n moved near own of | truth: kept | points: placed rms max kept | pictures | Hugin | cpu s\n");
  for (int n = range.from; n < range.to; ++n) {
    const HandHeldSet set = hand_held_set(n);
    const Calibration truth = true_hands(set, n);
    const auto files = written_or_exit(rendered_hands(set, truth, n), folder);
    std::vector<std::string> names;
    for (const HeadCalibration& head : truth.heads) names.push_back(head.name);
    const std::vector<KeptPoint> points = kept_points(room_of(set), truth, n);
    std::printf("%3d %5.2f %4d %3d %2zu", n, set.moved, set.near, set.own_lenses, names.size());
    const std::clock_t begun = std::clock();
    const host::OwnProgress silent = [](double, const std::string&) {};
    Result<host::RigPictures> rig = host::own_pictures(files);
    const auto heads = rig ? host::calibrate_by_pictures(*rig, {}, silent) : fail(rig.error());
    if (!heads) {
      std::printf(" | %s\n", heads.error().text().c_str());
      continue;
    }
    const Result<registration::Report> report = host::refined(*rig, silent);
    const double seconds = static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
    const Placed by_points = in_order(rig->calibration, *heads, files.size());
    const Placed by_pictures = in_order(report ? report->calibration : rig->calibration, *heads, files.size());
    const Result<Placed> hugin =
        beside_hugin ? placed_by_hugin(files, kHandViewDeg, folder) : Result<Placed>(by_points);
    const Placed& other = hugin ? *hugin : by_points;
    std::vector<bool> all;
    Placed is;
    for (std::size_t h = 0; h < files.size(); ++h) {
      all.push_back(by_points[h] && other[h]);
      is.emplace_back(truth.heads[h]);
      is.back()->position = {};
    }
    std::printf(" | %6.3f", errors_of(truth, is, all, points).kept_deg);
    print_hand("", by_points, other, truth, points);
    print_hand("", by_pictures, other, truth, points);
    if (hugin) {
      print_hand("", *hugin, by_points, truth, points);
    } else {
      std::printf(" | %s", hugin.error().text().c_str());
    }
    std::printf(" | %.1f\n", seconds);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  CLI::App app{"Lens, rotations and up from pictures alone, against the truth of rendered rigs"};
  int pairs = 0, hands = 0, first = 0;
  bool nominal = false, alone = false;
  std::string folder = (std::filesystem::temp_directory_path() / "nodal-from-pictures").string();
  app.add_option("--pairs", pairs, "pairs of fisheyes back to back (40 for all)");
  app.add_flag("--nominal", nominal, "the same pairs by their field of view, too, whole lenses estimated or not");
  app.add_option("--hands", hands, "sets of pictures taken from the hand (20 for all), beside Hugin");
  app.add_flag("--alone", alone, "without Hugin");
  app.add_option("--first", first, "the number of the first pair or set");
  app.add_option("--folder", folder, "where the rendered pictures go; what is there is removed");
  CLI11_PARSE(app, argc, argv);
  if (pairs > 0) nodal::bench::pairs({first, first + pairs}, folder, nominal);
  if (hands > 0) nodal::bench::hands({first, first + hands}, folder, !alone);
  return 0;
}
