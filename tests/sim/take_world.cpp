#include "tests/sim/take_world.h"

#include <algorithm>

#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::swarm {

using firmware::TakeAnswer;
using firmware::TakeRequest;
using firmware::TakeStage;
using hal::sim::SimDisk;

void TakeTally::add(const TakeTally& other) {
  takes += other.takes;
  recovered += other.recovered;
  refused += other.refused;
  kills += other.kills;
  power_cuts += other.power_cuts;
  exchanges += other.exchanges;
  pulls += other.pulls;
  brought += other.brought;
  removed += other.removed;
  ejects += other.ejects;
}

TakeWorld::TakeWorld(std::uint64_t seed) : random_(seed, "takes") {
  for (Card& card : cards_) card.disk = std::make_shared<SimDisk>(random_.next());
  slot_.insert(cards_[0].disk);
  for (Daemon& daemon : daemons_) begin(daemon);
}

std::optional<std::string> TakeWorld::run(int events) {
  for (int k = 0; k < events && !failure_; ++k) {
    act();
    check();
    if (!failure_) run_for(Duration::milliseconds(static_cast<std::int64_t>(50 + random_.below(1500))));
    check();
  }
  if (!failure_) check_all_finished();
  if (failure_) return "after '" + event_ + "': " + *failure_;
  return std::nullopt;
}

void TakeWorld::fail(std::string why) {
  if (!failure_) failure_ = std::move(why);
}

TakeWorld::Card* TakeWorld::card_in_slot() {
  const auto found = std::ranges::find(cards_, slot_.disk(), &Card::disk);
  return found == cards_.end() ? nullptr : &*found;
}

void TakeWorld::begin(Daemon& daemon) {
  daemon.port = slot_.port();
  daemon.stage = std::make_unique<TakeStage>(*daemon.port, clock_, TakeStage::Options{});
}

/// `cut`: nothing is finished.
void TakeWorld::end(Daemon& daemon, bool cut) {
  if (!daemon.stage) return;
  if (!cut) daemon.stage->close();
  note_durable(daemon);
  daemon.stage.reset();
  daemon.port.reset();
  daemon.card = nullptr;
}

void TakeWorld::run_for(Duration length) {
  const Instant until = clock_.now() + length;
  // Each is run for its part of the time, so that both have their turns; the clock is one.
  while (clock_.now() < until) {
    bool alive = false;
    for (Daemon& daemon : daemons_) {
      if (!daemon.stage) continue;
      alive = true;
      daemon.stage->run(Duration::milliseconds(50));
      follow(daemon);
    }
    if (!alive) clock_.advance_to(until);
  }
}

/// Sets that were on the disk for certain by the newest report.
void TakeWorld::note_durable(const Daemon& daemon) {
  if (!daemon.card) return;
  const firmware::TakeReport& report = daemon.stage->report();
  if (report.recording != daemon.take || !report.durable) return;
  const std::int64_t sets = (*report.durable - report.since).ms() * static_cast<std::int64_t>(kSetsASecond) / 1000 - 3;
  auto& durable = daemon.card->durable[take::take_folder(daemon.take)];
  durable = std::max(durable, static_cast<std::uint64_t>(std::max<std::int64_t>(0, sets)));
}

/// A take may end by itself.
void TakeWorld::follow(Daemon& daemon) {
  note_durable(daemon);
  if (daemon.card && daemon.stage->report().recording != daemon.take) daemon.card = nullptr;
}

void TakeWorld::act() {
  const std::uint64_t what = random_.below(10);
  if (what < 6) act_on(daemons_[random_.below(daemons_.size())]);
  else if (what < 9) handle_cards();
  else cut_power();
}

void TakeWorld::act_on(Daemon& daemon) {
  if (!daemon.stage) {
    event_ = "a start of nodald";
    return begin(daemon);
  }
  switch (random_.below(8)) {
    case 0:
    case 1:
    case 2: return start(daemon);
    case 3:
    case 4:
      event_ = "a stop";
      (void)daemon.stage->ask(TakeRequest::Stop{});
      return follow(daemon);
    case 5:
      event_ = "an eject";
      tally_.ejects += daemon.stage->ask(TakeRequest::Eject{}).result ? 1 : 0;
      return follow(daemon);
    case 6: {
      Card* const card =
          daemon.card ? daemon.card : card_in_slot();  // what it records on, as long as it has not noticed another
      if (!card || card->kept.empty()) return;
      event_ = "a request to delete";
      const auto kept = std::next(card->kept.begin(), static_cast<std::ptrdiff_t>(random_.below(card->kept.size())));
      const bool deleted = daemon.stage->ask(TakeRequest::Delete{std::stoull(kept->first)}).result.has_value();
      if (!deleted) return;
      ++tally_.removed;
      card->kept.erase(kept);
      return;
    }
    default:
      event_ = "a kill";
      ++tally_.kills;
      return end(daemon, true);
  }
}

void TakeWorld::start(Daemon& daemon) {
  event_ = "a start of a take";
  Card* const card = card_in_slot();
  const TakeAnswer answer = daemon.stage->start();
  follow(daemon);
  if (!answer.result) {
    ++tally_.refused;
    return;
  }
  if (!card) return fail("a take began, and no card is there");
  daemon.take = std::get<TakeAnswer::Done>(*answer.result).take;
  const std::string folder = take::take_folder(daemon.take);
  if (!card->used.insert(folder).second) return fail("take " + folder + " has the number of an earlier one");
  if (daemon.stage->report().recording == daemon.take) daemon.card = card;
  card->durable[folder] = 0;
}

void TakeWorld::handle_cards() {
  switch (random_.below(6)) {
    case 0:
    case 1:
      event_ = "an exchange of cards";
      ++tally_.exchanges;
      slot_.insert(cards_[random_.below(cards_.size())].disk);
      slot_.disk()->unplug(false);
      return;
    case 2:
      event_ = "a card is pulled";
      ++tally_.pulls;
      return slot_.pull();
    case 3:
    case 4: return bring_take();
    default: return remove_take();
  }
}

/// Somebody copies a take of any card to the one that is there, under a number that is free, such as the next one.
void TakeWorld::bring_take() {
  Card* const to = card_in_slot();
  const Card& from = cards_[random_.below(cards_.size())];
  if (!to || from.kept.empty()) return;
  event_ = "a take is brought by hand";
  const Files& files =
      std::next(from.kept.begin(), static_cast<std::ptrdiff_t>(random_.below(from.kept.size())))->second;
  std::uint64_t number = 1 + random_.below(3);
  for (const std::string& name : to->disk->list("").value_or(std::vector<std::string>())) {
    if (name.size() == 6 && std::ranges::all_of(name, [](char c) { return c >= '0' && c <= '9'; }))
      number = std::max<std::uint64_t>(number, std::stoull(name) + 1);
  }
  const std::string folder = take::take_folder(number);
  if (!to->disk->make_folder(folder)) return;
  for (const auto& [name, bytes] : files) {
    const auto file = to->disk->create(folder + "/" + name);
    const bool written = file && to->disk->write(*file, bytes) && to->disk->sync(*file);
    NODAL_ASSERT(written);
    to->disk->close(*file);
  }
  const bool synced = to->disk->sync_all().has_value();
  NODAL_ASSERT(synced);
  to->kept[folder] = files;
  ++tally_.brought;
}

void TakeWorld::remove_take() {
  Card* const card = card_in_slot();
  if (!card || card->kept.empty()) return;
  event_ = "a take is removed by hand";
  const auto kept = std::next(card->kept.begin(), static_cast<std::ptrdiff_t>(random_.below(card->kept.size())));
  for (const std::string& name : card->disk->list(kept->first).value_or(std::vector<std::string>()))
    (void)card->disk->remove(kept->first + "/" + name);
  (void)card->disk->remove(kept->first);
  (void)card->disk->sync_all();
  card->kept.erase(kept);
  ++tally_.removed;
}

/// The power of both boards fails, and with it that of the card.
void TakeWorld::cut_power() {
  event_ = "a power cut";
  ++tally_.power_cuts;
  for (Daemon& daemon : daemons_) end(daemon, true);
  for (Card& card : cards_) {
    const bool there = slot_.disk() == card.disk;
    card.disk = card.disk->after_power_loss(random_.next());
    if (there) slot_.insert(card.disk);
  }
}

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
    run_for(Duration::seconds(5));
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
