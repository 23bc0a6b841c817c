// The part of TakeWorld that compares the cards with the truth.
#include <algorithm>

#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "protocol/take/tally.h"
#include "tests/sim/take_world.h"

namespace nodal::swarm {

using hal::sim::SimDisk;

TakeWorld::Files TakeWorld::files_of(SimDisk& disk, const std::string& folder) {
  Files files;
  for (const std::string& name : disk.list(folder).value_or(std::vector<std::string>())) {
    if (auto bytes = disk.read(folder + "/" + name, std::uint64_t{1} << 30)) files[name] = std::move(*bytes);
  }
  return files;
}

void TakeWorld::check() {
  for (Card& card : cards_) {
    if (!failure_) check(card);
  }
  if (daemons_[0].card && daemons_[0].card == daemons_[1].card) fail("two nodalds record on one card");
}

void TakeWorld::check(Card& card) {
  if (!card.disk->identity()) return;  // it was pulled
  for (const auto& [folder, files] : card.kept) {
    if (files_of(*card.disk, folder) != files) return fail("take " + folder + " is finished, and was changed or lost");
  }
  for (auto next = card.durable.begin(); next != card.durable.end();) {
    const std::string folder = next->first;
    const Files files = files_of(*card.disk, folder);
    if (files.empty() && next->second > 0) return fail("take " + folder + ", of which sets were durable, is lost");
    if (!files.contains(take::kManifestFile)) {
      ++next;
      continue;
    }
    check_finished(card, folder, files);
    check_rates(card.rates[folder], folder, files);
    card.kept[folder] = files;
    next = card.durable.erase(next);
  }
}

void TakeWorld::check_finished(Card& card, const std::string& folder, const Files& files) {
  const Bytes& text = files.at(take::kManifestFile);
  const auto manifest = take::parse_manifest({reinterpret_cast<const char*>(text.data()), text.size()}, folder);
  if (!manifest) return fail(manifest.error().message);
  if (take::take_folder(manifest->number) != folder)
    return fail("take " + folder + " has another number in its manifest");
  for (const take::Manifest::File& file : manifest->files) {
    const auto found = files.find(file.name);
    take::PieceHashes hashes;
    if (found != files.end()) hashes.update(found->second);
    if (found == files.end() || take::digest_of(hashes.all()) != file.digest)
      return fail("take " + folder + ": " + file.name + " is not what its manifest says");
  }
  if (manifest->sets < card.durable.at(folder)) {
    return fail("take " + folder + " has " + std::to_string(manifest->sets) + " sets, and " +
                std::to_string(card.durable.at(folder)) + " were durable");
  }
  ++tally_.takes;
  tally_.recovered += manifest->ended == "recovered" ? 1 : 0;
}

/// Each set names its number on the rig, by which the world knows at which rate it came.
void TakeWorld::check_rates(const Rates& rates, const std::string& folder, const Files& files) {
  if (failure_ || rates.empty()) return;
  const auto expect = [&](FrameRate said, std::uint64_t set, const std::string& where) {
    const FrameRate came = std::prev(rates.upper_bound(set))->second;
    if (take::same_rate(said, came)) return;
    fail("take " + folder + ": " + where + " says " + std::to_string(said.numerator) + "/" +
         std::to_string(said.denominator) + " Hz, and set " + std::to_string(set) + " came at " +
         std::to_string(came.numerator) + "/" + std::to_string(came.denominator) + " Hz");
  };
  const auto text = [&](const std::string& name) {
    const Bytes& bytes = files.at(name);
    return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  if (const auto about = take::parse_take_json(text(take::kTakeFile), folder)) expect(about->rate, 0, "take.json");
  std::vector<FrameRate> of_segments;
  for (const auto& [name, bytes] : files) {
    if (!name.starts_with("evidence-")) continue;
    const auto segment = take::read_evidence(bytes, name);
    if (!segment) return fail(segment.error().message);
    const FrameRate said = take::rate_of(segment->begin, {1, 1});
    for (const take::wire::Set& set : segment->sets) expect(said, set.number(), name);
    const bool other = of_segments.empty() || !take::same_rate(of_segments.back(), said);
    if (!segment->sets.empty() && other) of_segments.push_back(said);
  }
  const auto manifest = take::parse_manifest(text(take::kManifestFile), folder);
  const bool same =
      manifest && std::ranges::equal(manifest->rates, of_segments, take::same_rate, &take::RateChange::rate);
  if (!same) fail("take " + folder + ": the rates of the manifest are not those of its segments");
}

/// Nothing disturbs the rigs any more.
void TakeWorld::check_all_finished() {
  event_ = "the end of all faults";
  for (Daemon& daemon : daemons_) end(daemon, false);
  check();
  for (Card& card : cards_) {
    if (failure_) return;
    card.disk->unplug(false);
    slot_.insert(card.disk);
    begin(daemons_[0]);
    run_for(Duration::seconds(5));  // no set is needed to recover a take
    check(card);
    for (const firmware::TakeEntry& take : daemons_[0].stage->list()) {
      if (take.state == firmware::TakeState::kComplete) continue;
      fail("take " + std::to_string(take.number) + " is " + std::string(take_state_name(take.state)) + ": " +
           take.problem);
    }
    end(daemons_[0], false);
  }
}

}  // namespace nodal::swarm
