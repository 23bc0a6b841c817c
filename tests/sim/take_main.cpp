// take_swarm: runs seeds of TakeWorld, prints statistics, and for a failure the command that reproduces it.
#include <charconv>
#include <cstdio>
#include <cstring>
#include <string>

#include "tests/sim/take_world.h"

namespace nodal::swarm {
namespace {

constexpr int kEvents = 60;

int run(int argc, char** argv) {
  std::uint64_t first = 1, seeds = 1000;
  bool canary = false;
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    std::uint64_t number = 0;
    if (option == "--canary") {
      canary = true;
      continue;
    }
    const char* const text = i + 1 < argc ? argv[++i] : "";
    const char* const end = text + std::strlen(text);
    const bool good = std::from_chars(text, end, number).ptr == end && number > 0;
    if (good && option == "--seeds") seeds = number;
    else if (good && option == "--first") first = number;
    else if (good && option == "--seed") first = number, seeds = 1;
    else return std::fprintf(stderr, "usage: take_swarm [--seeds N] [--first S] [--seed S] [--canary]\n"), 2;
  }
  TakeTally tally;
  for (std::uint64_t seed = first; seed < first + seeds; ++seed) {
    TakeWorld world(seed);
    const auto failure = world.run(kEvents);
    tally.add(world.tally());
    if (!failure) continue;
    std::printf("seed %llu: %s\nreplay: take_swarm --seed %llu\n", static_cast<unsigned long long>(seed),
                failure->c_str(), static_cast<unsigned long long>(seed));
    return canary ? 0 : 1;
  }
  std::printf(
      "%llu seeds: %llu takes finished, %llu of them recovered; %llu starts refused, %llu kills, %llu power cuts, "
      "%llu exchanges, %llu pulls, %llu takes brought, %llu removed, %llu ejects, %llu hang-ups, %llu vanished hosts, "
      "%llu floods, "
      "%llu changes of rate, %llu clocks set: none lost, overwritten, relabelled or with two owners\n",
      static_cast<unsigned long long>(seeds), static_cast<unsigned long long>(tally.takes),
      static_cast<unsigned long long>(tally.recovered), static_cast<unsigned long long>(tally.refused),
      static_cast<unsigned long long>(tally.kills), static_cast<unsigned long long>(tally.power_cuts),
      static_cast<unsigned long long>(tally.exchanges), static_cast<unsigned long long>(tally.pulls),
      static_cast<unsigned long long>(tally.brought), static_cast<unsigned long long>(tally.removed),
      static_cast<unsigned long long>(tally.ejects), static_cast<unsigned long long>(tally.hang_ups),
      static_cast<unsigned long long>(tally.vanished), static_cast<unsigned long long>(tally.floods),
      static_cast<unsigned long long>(tally.rates), static_cast<unsigned long long>(tally.clock_sets));
  return canary ? 1 : 0;
}

}  // namespace
}  // namespace nodal::swarm

int main(int argc, char** argv) { return nodal::swarm::run(argc, argv); }
