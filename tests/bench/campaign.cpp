// Are registration's claims true? Rigs drawn by seeds, with a table by fault (see drawn_rig.h).
//   build/release/bin/bench_campaign [--rigs 200] [--first 0] [--list] [--no-drift]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <map>

#include "tests/bench/drawn_rig.h"

namespace nodal::bench {
namespace {

constexpr double kHonest = 3;  // errors up to so many claimed standard deviations

struct Row {
  int rigs = 0, refused = 0, due = 0, named = 0, falsely = 0, not_placed = 0, false_moves = 0, drift_refused = 0;
  std::vector<double> ratios, errors, claims;
  void add(const Verdict& verdict) {
    ++rigs;
    refused += verdict.refused.empty() ? 0 : 1;
    for (const Reasons& reason : verdict.reasons) {
      due += reason.matters ? 1 : 0;
      named += reason.matters && reason.named ? 1 : 0;
      falsely += reason.named && !reason.present ? 1 : 0;
    }
    not_placed += static_cast<int>(verdict.not_placed.size());
    false_moves += verdict.false_moves;
    drift_refused += verdict.drift_refused.empty() ? 0 : 1;
    for (const HeadClaim& head : verdict.placed) {
      ratios.push_back(head.ratio());
      errors.push_back(head.error_deg);
      claims.push_back(head.claimed_deg);
    }
  }
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

void print(const char* name, const Row& row) {
  const auto beyond = std::ranges::count_if(row.ratios, [](double ratio) { return !(ratio <= kHonest); });
  const double share =
      row.ratios.empty() ? 100 : 100 - 100.0 * static_cast<double>(beyond) / static_cast<double>(row.ratios.size());
  std::printf(
      "| %-16s | %4d | %3d | %4zu | %3d | %6.4f | %6.4f | %4.2f | %5.2f | %6.2f | %5.1f %% | %3d of %3d, %2d | %2d, "
      "%2d "
      "|\n",
      name, row.rigs, row.refused, row.ratios.size(), row.not_placed, quantile(row.errors, 0.5),
      quantile(row.claims, 0.5), quantile(row.ratios, 0.5), quantile(row.ratios, 0.95), quantile(row.ratios, 1), share,
      row.named, row.due, row.falsely, row.false_moves, row.drift_refused);
}

void list(std::uint64_t seed, const DrawnRig& rig, const Verdict& verdict) {
  std::printf("rig %llu: %s, %zu heads, free %d\n", static_cast<unsigned long long>(seed), name_of(rig.fault),
              rig.prior.heads.size(), static_cast<int>(rig.options.free));
  for (std::size_t k = 0; k < verdict.reasons.size(); ++k) {
    constexpr const char* kNames[] = {"detail", "near things", "lenses"};
    const Reasons& reason = verdict.reasons[k];
    if (reason.matters != reason.named) {
      std::printf("  %s: %s\n", kNames[k],
                  !reason.named    ? "not named"
                  : reason.present ? "named, too small"
                                   : "named, not there");
    }
  }
  if (!verdict.refused.empty()) std::printf("  refused: %s\n", verdict.refused.c_str());
  if (!verdict.drift_refused.empty()) std::printf("  drift: %s\n", verdict.drift_refused.c_str());
  for (const std::string& warning : verdict.warnings) std::printf("  warning: %s\n", warning.c_str());
  if (verdict.false_moves > 0) std::printf("  drift: %d heads said to have moved\n", verdict.false_moves);
  for (const HeadClaim& head : verdict.placed) {
    std::printf("  %s %.5f of %.5f%s\n", head.name.c_str(), head.error_deg, head.claimed_deg,
                head.ratio() <= kHonest ? "" : " *");
  }
}

void run(std::uint64_t first, int rigs, bool listed, bool with_drift) {
  std::map<Fault, Row> rows;
  Row all;
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(rigs); ++seed) {
    const DrawnRig rig = draw_rig(seed);
    const Verdict verdict = judge(rig, with_drift);
    if (listed) list(seed, rig, verdict);
    rows[rig.fault].add(verdict);
    all.add(verdict);
    std::fflush(stdout);
  }
  std::printf(
      "| fault | rigs | refused | placed | not placed | error deg | claimed deg | error/claimed | 95 %% | worst | at "
      "most %g | reasons "
      "named, false | drift: moved, refused |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      kHonest);
  for (const auto& [fault, row] : rows) print(name_of(fault), row);
  print("all", all);
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  CLI::App app{"Registers rigs drawn by seeds, and compares errors with the claimed uncertainties"};
  int rigs = 200;
  std::uint64_t first = 0;
  bool listed = false, without_drift = false;
  app.add_option("--rigs", rigs, "how many");
  app.add_option("--first", first, "the first seed");
  app.add_flag("--list", listed, "each rig, too");
  app.add_flag("--no-drift", without_drift, "do not measure drift from the result");
  CLI11_PARSE(app, argc, argv);
  nodal::bench::run(first, rigs, listed, !without_drift);
  return 0;
}
