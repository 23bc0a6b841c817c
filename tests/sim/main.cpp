// swarm: runs seeds, prints statistics, and for a failure the command that reproduces it.
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <new>
#include <string>

#include "tests/sim/swarm.h"

namespace nodal::swarm {
namespace {

struct Options {
  std::uint64_t first = 1;
  std::uint64_t seeds = 500;
  std::int64_t minutes = 10;
  int jobs = 2;
  bool coverage = false;  ///< every combination of state, fault and number of heads must occur
  bool quiet = false;
  bool canary = false;  ///< a bug was planted: success means finding it
  DrawOptions draw;
  std::string program;
};

/// A worker process's result for its parent, in shared memory.
struct Report {
  std::uint64_t seed = 0;         ///< seed in progress; 0: none
  std::atomic<bool> stop{false};  ///< a process has found a failure
  std::uint64_t done = 0;
  std::uint64_t failed_seed = 0;
  std::uint64_t trace = 0;
  Tally tally;
  char failure[1024] = {};
};

std::string replay(const Options& options, std::uint64_t seed) {
  std::string command =
      options.program + " --seed " + std::to_string(seed) + " --minutes " + std::to_string(options.minutes);
  if (!options.draw.faults) command += " --no-faults";
  if (options.draw.heads) command += " --heads " + std::to_string(options.draw.heads);
  if (options.draw.ntsc) command += " --ntsc";
  if (options.draw.hostile) command += " --hostile";
  return command;
}

/// Runs seeds first + job, + jobs, and so on.
void work(const Options& options, int job, Report& report) {
  const auto jobs = static_cast<std::uint64_t>(options.jobs);
  for (std::uint64_t i = static_cast<std::uint64_t>(job); i < options.seeds && !report.stop; i += jobs) {
    report.seed = options.first + i;
    const Outcome outcome = Swarm(report.seed, options.draw).run(Duration::seconds(60 * options.minutes));
    report.tally.add(outcome.tally);
    report.trace += outcome.trace * (2 * report.seed + 1);  // independent of the order
    ++report.done;
    if (!outcome.failure) continue;
    report.failed_seed = report.seed;
    std::snprintf(report.failure, sizeof report.failure, "%s", outcome.failure->c_str());
    return;
  }
  report.seed = 0;
}

std::uint64_t lost_in(const Tally& tally) {
  std::uint64_t lost = tally.never_came;
  for (const std::uint64_t losses : tally.losses) lost += losses;
  return lost;
}

void print_tally(const Tally& tally) {
  const auto n = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
  std::printf("  %llu events, %llu frames, %llu sets (%llu full, %llu locked), %llu raymaps checked\n", n(tally.events),
              n(tally.frames), n(tally.sets), n(tally.full_sets), n(tally.locked_sets), n(tally.raymaps));
  std::printf("  %llu episodes, %llu of them storms, %llu processes killed, %llu answers, %llu calibrations uploaded\n",
              n(tally.episodes), n(tally.storms), n(tally.kills), n(tally.replies), n(tally.uploads));
  std::printf(
      "  worst spread of a locked set, in truth: %lld us; full sets again %lld ms after a replug, %lld ms after "
      "faults; locked again %lld ms or %lld periods, %lld ms or %lld, at worst\n",
      static_cast<long long>(tally.worst_locked_spread_ns / 1000),
      static_cast<long long>(tally.slowest_full_replug / 1'000'000),
      static_cast<long long>(tally.slowest_full_recovery / 1'000'000),
      static_cast<long long>(tally.slowest_replug.ns / 1'000'000), static_cast<long long>(tally.slowest_replug.periods),
      static_cast<long long>(tally.slowest_recovery.ns / 1'000'000),
      static_cast<long long>(tally.slowest_recovery.periods));
  std::printf("  wired heads: watched in %llu steps, in %llu of them reported as not following\n", n(tally.watched),
              n(tally.not_following));
  std::printf("  without a trigger %llu sets were locked; heads in step again %lld periods after faults, at worst\n",
              n(tally.aligned_sets), static_cast<long long>(tally.slowest_alignment));
  std::printf(
      "  %llu crowds of hostile clients; good ones were served %llu times, %lld ms at worst, after %llu refusals and "
      "%llu dropped connections; %llu KiB of memory at most, %llu KiB of it left\n",
      n(tally.crowds), n(tally.good_answers), static_cast<long long>(tally.slowest_good / 1'000'000),
      n(tally.good_refused), n(tally.good_dropped), n(tally.most_live >> 10), n(tally.most_left >> 10));
  std::printf("  frames lost:");
  const std::uint64_t lost = lost_in(tally);
  if (tally.never_came > 0) std::printf(" before they could be taken %llu", n(tally.never_came));
  for (std::size_t i = 0; i < tally.losses.size(); ++i) {
    if (tally.losses[i] == 0) continue;
    std::printf(" %s %llu", firmware::loss_reason_name(static_cast<firmware::LossReason>(i)).data(),
                n(tally.losses[i]));
  }
  std::printf(lost == 0 ? " none\n" : "\n");
}

/// The number of combinations of state, fault and number of heads that did not occur.
int print_coverage(const Tally& tally) {
  int missing = 0;
  std::uint64_t least = ~std::uint64_t{0};
  const auto tell = [&](std::uint64_t visits, const std::string& what) {
    least = std::min(least, visits);
    if (visits != 0) return;
    ++missing;
    std::printf("  never visited: %s\n", what.c_str());
  };
  for (int s = 0; s < kHeadStates; ++s) {
    for (int f = 0; f < kHeadFaults; ++f) {
      for (int m = 0; m < kHowMany; ++m) {
        tell(tally.visited[static_cast<std::size_t>(s)][static_cast<std::size_t>(f)][static_cast<std::size_t>(m)],
             std::string(name_of(static_cast<HowMany>(m))) + " " + std::string(name_of(static_cast<HeadState>(s))) +
                 ": " + std::string(name_of(static_cast<HeadFault>(f))));
      }
    }
  }
  for (int f = 0; f < kRigFaults; ++f) {
    tell(tally.rig_faults[static_cast<std::size_t>(f)], std::string(name_of(static_cast<RigFault>(f))));
  }
  for (int k = 0; k < kHostileKinds; ++k) {
    tell(tally.hostile[static_cast<std::size_t>(k)],
         "hostile clients: " + std::string(name_of(static_cast<HostileKind>(k))));
  }
  std::printf(
      "  %d head states x %d faults x one, two, all, %d faults of the rig, and %d kinds of hostile clients: each "
      "visited %llu times or more\n",
      kHeadStates, kHeadFaults, kRigFaults, kHostileKinds, static_cast<unsigned long long>(least));
  return missing;
}

int run(const Options& options) {
  const auto begun = std::chrono::steady_clock::now();
  const std::size_t bytes = sizeof(Report) * static_cast<std::size_t>(options.jobs);
  void* shared = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) return 1;
  auto* reports = static_cast<Report*>(shared);
  for (int job = 0; job < options.jobs; ++job) {
    new (&reports[job]) Report();
    if (options.jobs == 1) {
      work(options, 0, reports[0]);
    } else if (fork() == 0) {
      work(options, job, reports[job]);
      _exit(reports[job].failed_seed == 0 ? 0 : 1);
    }
  }
  for (int status = 0; wait(&status) > 0;) {
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) continue;
    for (int job = 0; job < options.jobs; ++job) reports[job].stop = true;
  }
  Report all;
  int failures = 0;
  std::fflush(stdout);
  for (int job = 0; job < options.jobs; ++job) {
    const Report& report = reports[job];
    all.tally.add(report.tally);
    all.done += report.done;
    all.trace += report.trace;
    if (report.seed == 0) continue;
    ++failures;
    const std::uint64_t seed = report.failed_seed ? report.failed_seed : report.seed;
    std::printf("FAILED: seed %llu: %s\n", static_cast<unsigned long long>(seed),
                report.failed_seed ? report.failure : "the program died");
    std::printf("replay: %s\n", replay(options, seed).c_str());
  }
  const auto took = std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begun);
  std::printf("%llu seeds x %lld virtual minutes in %lld.%lld s of wall time; trace %016llx\n",
              static_cast<unsigned long long>(all.done), static_cast<long long>(options.minutes),
              static_cast<long long>(took.count() / 1000), static_cast<long long>(took.count() % 1000 / 100),
              static_cast<unsigned long long>(all.trace));
  if (!options.quiet) print_tally(all.tally);
  if (!options.draw.faults && (lost_in(all.tally) > 0 || all.tally.full_sets != all.tally.sets)) {
    std::printf("FAILED: nothing went wrong, and frames were lost or sets not full\n");
    ++failures;
  }
  if (failures == 0 && options.coverage) failures += print_coverage(all.tally);
  if (options.canary)
    std::printf(failures > 0 ? "the planted bug was found\n" : "FAILED: a planted bug was not found\n");
  return (failures == 0) != options.canary ? 0 : 1;
}

constexpr const char* kHelp =
    "swarm: a whole rig in virtual time, every fault there is, and oracles that know the truth\n"
    "  --seeds N      how many (500)\n"
    "  --first S      the first of them (1)\n"
    "  --seed S       only this one, in this process\n"
    "  --minutes M    virtual minutes of each (10)\n"
    "  --jobs J       processes (2)\n"
    "  --coverage     fails when a fault was not visited in every state of one, two and all heads\n"
    "  --no-faults    nothing goes wrong; with it, a frame lost is a failure\n"
    "  --heads H      not drawn\n"
    "  --ntsc         29.97 a second and genlocked, not drawn\n"
    "  --hostile      nothing befalls the rigs but hostile clients beside good ones\n"
    "  --canary       a bug was planted in this program: fails when it is not found\n"
    "  --quiet        one line\n";

bool parse(int argc, char** argv, Options& options) {
  options.program = argv[0];
  for (int i = 1; i < argc; ++i) {
    const std::string flag = argv[i];
    if (flag == "--coverage") options.coverage = true;
    else if (flag == "--no-faults") options.draw.faults = false;
    else if (flag == "--ntsc") options.draw.ntsc = true;
    else if (flag == "--hostile") options.draw.hostile = true;
    else if (flag == "--quiet") options.quiet = true;
    else if (flag == "--canary") options.canary = true;
    else {
      std::uint64_t value = 0;
      const char* text = i + 1 < argc ? argv[++i] : "";
      const auto [end, error] = std::from_chars(text, text + std::strlen(text), value);
      if (error != std::errc{} || *end != 0) return false;
      if (flag == "--seeds") options.seeds = value;
      else if (flag == "--first") options.first = value;
      else if (flag == "--seed") options.first = value, options.seeds = 1, options.jobs = 1;
      else if (flag == "--minutes") options.minutes = static_cast<std::int64_t>(value);
      else if (flag == "--jobs") options.jobs = std::max(1, static_cast<int>(value));
      else if (flag == "--heads" && value >= 1 && value <= kMaxHeads) options.draw.heads = static_cast<int>(value);
      else return false;
    }
  }
  return true;
}

}  // namespace
}  // namespace nodal::swarm

int main(int argc, char** argv) {
  nodal::swarm::Options options;
  if (!nodal::swarm::parse(argc, argv, options)) {
    std::fputs(nodal::swarm::kHelp, stderr);
    return 2;
  }
  return nodal::swarm::run(options);
}
