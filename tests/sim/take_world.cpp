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
  hang_ups += other.hang_ups;
  vanished += other.vanished;
  rates += other.rates;
  clock_sets += other.clock_sets;
  floods += other.floods;
}

namespace {

constexpr FrameRate kOrdinary{5, 1};
constexpr Duration kOpenRow = Duration::milliseconds(600);
constexpr std::array<FrameRate, 6> kRates{{{1, 1000}, {1, 60}, {1, 2}, {30'000, 1001}, {60, 1}, {240, 1}}};

/// A length that is for kOrdinary, at this rate: as many sets come. At fast rates it has more of them.
Duration scaled(Duration length, FrameRate rate) {
  const double factor = static_cast<double>(rate.period().ns()) / static_cast<double>(kOrdinary.period().ns());
  return Duration::nanoseconds(static_cast<std::int64_t>(static_cast<double>(length.ns()) * std::max(0.25, factor)));
}

}  // namespace

TakeWorld::TakeWorld(std::uint64_t seed)
    : random_(seed, "takes"), rate_(random_.below(2) == 0 ? kOrdinary : kRates[random_.below(kRates.size())]) {
  for (Card& card : cards_) card.disk = std::make_shared<SimDisk>(random_.next());
  slot_.insert(cards_[0].disk);
  for (Daemon& daemon : daemons_) begin(daemon);
}

std::optional<std::string> TakeWorld::run(int events) {
  for (int k = 0; k < events && !failure_; ++k) {
    act();
    check();
    const Duration length = Duration::milliseconds(static_cast<std::int64_t>(50 + random_.below(1500)));
    if (!failure_) run_for(scaled(length, rate_));
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
  TakeStage::Options options;
  options.rate = some_rate();
  options.configured = FrameRate{25, 1};
  daemon.stage = std::make_unique<TakeStage>(*daemon.port, clock_, options);
}

/// The world's, its double or its half.
FrameRate TakeWorld::some_rate() {
  const std::uint64_t up = 1 + random_.below(2), down = 1 + random_.below(2);
  return FrameRate::make(rate_.numerator * up, rate_.denominator * down).value_or(rate_);
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
  const Duration turn = scaled(Duration::milliseconds(50), rate_);
  // Each is run for its part of the time, so that both have their turns; the clock is one.
  while (clock_.now() < until) {
    bool alive = false;
    for (Daemon& daemon : daemons_) {
      if (!daemon.stage) continue;
      alive = true;
      daemon.stage->run(turn);
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
  const std::vector<Instant>& times = daemon.stage->times();
  const auto first = std::ranges::lower_bound(times, report.since);
  // What is in the recorder's open row is not there yet.
  const std::ptrdiff_t sets = std::min(std::ranges::lower_bound(times, *report.durable) - first - 3,
                                       std::ranges::lower_bound(times, *report.durable - kOpenRow) - first);
  auto& durable = daemon.card->durable[take::take_folder(daemon.take)];
  durable = std::max(durable, static_cast<std::uint64_t>(std::max<std::ptrdiff_t>(0, sets)));
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
  if (random_.below(4) == 0) return act_as_host(daemon);
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
      // What it records on, as long as it has not noticed another.
      Card* const card = daemon.card ? daemon.card : card_in_slot();
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

/// What is rarer.
void TakeWorld::act_as_host(Daemon& daemon) {
  switch (random_.below(5)) {
    case 0: return hang_up(daemon);
    case 1: return vanish(daemon);
    case 2: return flood(daemon);
    case 3: return change_rate(daemon);
    default: return set_clock(daemon);
  }
}

/// nodald ends by itself, as at SIGHUP or SIGTERM: what it records is finished, if the card is there.
void TakeWorld::hang_up(Daemon& daemon) {
  event_ = "a hang-up of nodald";
  ++tally_.hang_ups;
  Card* const card = daemon.card;
  const std::uint64_t take = daemon.take;
  end(daemon, false);
  if (!card || slot_.disk() != card->disk || !card->disk->identity()) return;
  if (!files_of(*card->disk, take::take_folder(take)).contains(take::kManifestFile))
    fail("take " + std::to_string(take) + " was not finished when nodald ended");
}

/// A host that asks for something and is gone before the answer.
void TakeWorld::vanish(Daemon& daemon) {
  event_ = "a host that vanishes";
  ++tally_.vanished;
  if (random_.below(2) == 0) return start(daemon, false);
  daemon.stage->request(TakeRequest::Stop{});
  daemon.stage->run(Duration::milliseconds(1));
  daemon.stage->drop_answers();
  follow(daemon);
}

/// Requests without a pause, none of which changes a take.
void TakeWorld::flood(Daemon& daemon) {
  event_ = "a flood of requests";
  ++tally_.floods;
  constexpr std::size_t kFlood = 60;
  for (std::size_t k = 0; k < kFlood; ++k) {
    switch (random_.below(4)) {
      case 0: daemon.stage->request(TakeRequest::List{}); break;
      case 1: daemon.stage->request(TakeRequest::Mark{std::string(random_.below(300), '\x1b')}); break;
      case 2: daemon.stage->request(TakeRequest::Delete{999'999}); break;
      default: daemon.stage->request(TakeRequest::Protect{999'999, true}); break;
    }
  }
  for (std::size_t k = 0; k < kFlood; ++k) {
    const TakeAnswer answer = daemon.stage->next_answer();
    if (!answer.result && answer.result.error().code == Errc::kTimeout) return fail("a request was not answered");
  }
  follow(daemon);
}

void TakeWorld::change_rate(Daemon& daemon) {
  if (daemon.stage->offered() == 0) return;
  event_ = "a change of the rate";
  ++tally_.rates;
  daemon.stage->set_rate(some_rate());
  if (daemon.card) {
    daemon.card->rates[take::take_folder(daemon.take)][daemon.stage->offered()] = daemon.stage->rate();
  }
}

void TakeWorld::set_clock(Daemon& daemon) {
  event_ = "a board's clock is set";
  ++tally_.clock_sets;
  constexpr std::array<std::int64_t, 4> kTo{0, TakeStage::kUtcNs - 86'400'000'000'000, TakeStage::kUtcNs + 1,
                                            take::kMaxUtcNs};
  const std::uint64_t which = random_.below(kTo.size() + 1);
  daemon.stage->set_utc(which < kTo.size() ? std::optional(kTo[which]) : std::nullopt);
}

/// Without waiting for the answer if the host is gone.
void TakeWorld::start(Daemon& daemon, bool waits) {
  if (waits) event_ = "a start of a take";
  Card* const card = card_in_slot();
  std::uint64_t take = 0;
  if (waits) {
    const TakeAnswer answer = daemon.stage->start();
    if (answer.result) take = std::get<TakeAnswer::Done>(*answer.result).take;
  } else {
    const auto before = daemon.stage->report().recording;
    daemon.stage->request(daemon.stage->start_request());
    daemon.stage->run(Duration::milliseconds(1));
    daemon.stage->drop_answers();
    const auto now = daemon.stage->report().recording;
    if (now && now != before) take = *now;
  }
  follow(daemon);
  if (take == 0) {
    ++tally_.refused;
    return;
  }
  if (!card) return fail("a take began, and no card is there");
  daemon.take = take;
  const std::string folder = take::take_folder(daemon.take);
  if (!card->used.insert(folder).second) return fail("take " + folder + " has the number of an earlier one");
  if (daemon.stage->report().recording == daemon.take) daemon.card = card;
  card->durable[folder] = 0;
  card->rates[folder] = {{0, daemon.stage->rate()}};
}

/// Shorter than it takes until the next sync, or longer.
void TakeWorld::lose_contact() {
  const auto disk = slot_.disk();
  if (!disk) return;
  event_ = "a card that has no contact for a moment";
  ++tally_.pulls;
  slot_.pull();
  run_for(Duration::milliseconds(static_cast<std::int64_t>(10 + random_.below(1200))));
  slot_.insert(disk);
  disk->unplug(false);
}

void TakeWorld::handle_cards() {
  switch (random_.below(7)) {
    case 6: return lose_contact();
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
    const bool present = slot_.disk() == card.disk;
    card.disk = card.disk->after_power_loss(random_.next());
    if (present) slot_.insert(card.disk);
  }
}

}  // namespace nodal::swarm
