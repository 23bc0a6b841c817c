// siege: attacks a nodald in all ways at once; prints a table of what good clients measured before, during and after.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <string>

#include "attackers.h"
#include "besieged.h"
#include "nodald_process.h"
#include "turns.h"

namespace nodal::crash {
namespace {

// Limits for every phase, relative to the quiet phase.
constexpr double kMaxResident = 1.5;
constexpr double kLogBytesAtOnce = 32 << 10, kLogBytesAMinute = 32 << 10;
constexpr std::uint64_t kSettingsBytes = 64 << 10;
constexpr double kEveryReplyMs = 30'000;  ///< on a busy machine
// On a machine that runs nothing else.
constexpr double kReplyMs = 2'000;
constexpr double kMinRate = 0.95;

struct Options {
  std::string rig;  ///< a folder; empty: the small rig of the tests
  std::int64_t quiet_s = 120, attack_s = 3600;
  bool timed = true;  ///< whether speeds are tested too
  bool turns = false, quick = false;
  std::string kind;  ///< the only occupation, with --turns; empty: all
};

void print_header() {
  std::printf("%-8s %7s %11s %8s %8s %8s %8s %5s %10s %9s %6s  %s\n", "phase", "s", "raymaps/s", "sets/s", "median",
              "worst", "RSS", "fds", "log", "settings", "again", "sets lost");
  std::printf("%-8s %7s %11s %8s %8s %8s %8s %5s %10s %9s %6s\n", "", "", "", "", "ms", "ms", "MiB", "", "bytes/min",
              "bytes", "");
}

void print(const PhaseReport& row) {
  std::printf("%-8s %7.1f %11.2f %8.2f %8.1f %8.1f %8.1f %5llu %10.0f %9llu %6llu  %s\n", row.name.c_str(), row.seconds,
              row.rate(), static_cast<double>(row.sets) / row.seconds, row.median_ms(), row.worst_ms(),
              static_cast<double>(row.resident_bytes) / (1 << 20), static_cast<unsigned long long>(row.descriptors),
              row.log_bytes_a_minute(), static_cast<unsigned long long>(row.settings_bytes),
              static_cast<unsigned long long>(row.reconnects), row.lost.c_str());
  std::fflush(stdout);
}

int broken(const PhaseReport& row, const PhaseReport& quiet, const Options& options, bool rate_changed) {
  int many = 0;
  const auto must = [&](bool holds, const char* what) {
    if (!holds) std::printf("FAILED: %s: %s\n", row.name.c_str(), what);
    many += holds ? 0 : 1;
  };
  must(static_cast<double>(row.resident_bytes) <= kMaxResident * static_cast<double>(quiet.resident_bytes),
       "more memory than 1.5 times the quiet rig's");
  must(static_cast<double>(row.log_bytes) <= kLogBytesAtOnce + kLogBytesAMinute * row.seconds / 60,
       "more log than 32 KiB and 32 KiB a minute");
  must(row.settings_bytes <= kSettingsBytes, "more than 64 KiB of settings");
  must(row.raymaps > 0, "the good client got no raymap");
  must(row.worst_ms() <= kEveryReplyMs, "a good client's request was not answered");
  if (!options.timed) return many;
  must(row.worst_ms() <= kReplyMs, "a good client waited for more than 2 s");
  if (!rate_changed) must(row.rate() >= kMinRate * quiet.rate(), "fewer raymaps than 0.95 times the quiet rig's");
  return many;
}

int run(const Options& options) {
  const RigFolder small;
  Besieged rig(options.rig.empty() ? small.path : std::filesystem::path(options.rig));
  const std::chrono::seconds quiet_for(options.quiet_s), attack_for(options.attack_s);
  const std::chrono::seconds change_for = std::max(quiet_for / 2, std::chrono::seconds(1));
  int failures = 0;
  std::optional<PhaseReport> quiet;
  const auto phase = [&](const std::string& name, std::chrono::seconds how_long, bool rate_changed = false) {
    const auto row = rig.watch(name, how_long);
    if (!row) {
      std::printf("FAILED: %s\n", rig.why().c_str());
      return false;
    }
    print(*row);
    if (!quiet) quiet = row;
    failures += broken(*row, *quiet, options, rate_changed);
    return true;
  };
  const auto under = [&](Attack attack, const std::string& name, std::chrono::seconds how_long) {
    Attackers attackers(attack, rig.socket(), rig.document());
    const bool done = phase(name, how_long, attack == Attack::kChange);
    const double cpu = attackers.cpu_seconds();
    if (done) std::printf("%-8s   the attackers used %.1f s of CPU time\n", "", cpu);
    if (attackers.running()) return done;
    std::printf("FAILED: the attackers died\n");
    return false;
  };
  if (!rig.start()) {
    std::printf("FAILED: %s\n", rig.why().c_str());
    return 1;
  }
  print_header();
  const bool all = phase("quiet", quiet_for) && under(Attack::kLoad, "attacks", attack_for) &&
                   under(Attack::kChange, "changes", change_for);
  if (all && !rig.set_up()) {
    std::printf("FAILED: after the attacks the rig cannot be set up again: %s\n", rig.why().c_str());
    return 1;
  }
  if (!all || !phase("after", quiet_for)) return 1;
  if (const int code = rig.stop(); code != 0) {
    std::printf("FAILED: nodald's exit code is %d\n", code);
    ++failures;
  }
  if (failures == 0) std::printf("everything held\n");
  return failures == 0 ? 0 : 1;
}

constexpr const char* kHelp =
    "siege: attacks a nodald all ways at once\n"
    "  --rig DIR    a folder with rig.toml and the calibration that its [sim] names (default: five small heads)\n"
    "  --quiet S    seconds before and after (120)\n"
    "  --attack S   seconds of attacks (3600)\n"
    "  --turns      instead: how long one `nodal` waits while other hosts keep what it asks for\n"
    "  --quick      with --turns: only with as many hosts as there may be\n"
    "  --kind NAME  with --turns: only this kind of request\n"
    "  --untimed    only memory, log, settings and replies are judged: for a machine that is busy\n";

bool parse(int argc, char** argv, Options& options) {
  for (int i = 1; i < argc; ++i) {
    const std::string flag = argv[i];
    if (flag == "--untimed" || flag == "--turns" || flag == "--quick") {
      (flag == "--untimed" ? options.timed : flag == "--turns" ? options.turns : options.quick) = flag != "--untimed";
      continue;
    }
    const char* text = i + 1 < argc ? argv[++i] : "";
    if (flag == "--rig" || flag == "--kind") {
      (flag == "--rig" ? options.rig : options.kind) = text;
      continue;
    }
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text, text + std::strlen(text), value);
    if (error != std::errc{} || *end != 0 || value < 1) return false;
    if (flag == "--quiet") options.quiet_s = value;
    else if (flag == "--attack") options.attack_s = value;
    else return false;
  }
  return true;
}

}  // namespace
}  // namespace nodal::crash

int main(int argc, char** argv) {
  using namespace nodal::crash;
  Options options;
  if (parse(argc, argv, options))
    return options.turns ? (run_turns(options.timed, options.quick, options.kind) == 0 ? 0 : 1) : run(options);
  std::fputs(kHelp, stderr);
  return 2;
}
