#include "tests/sim/oracle.h"

#include <algorithm>
#include <bit>

#include "protocol/upload.h"

namespace nodal::swarm {
namespace {

using firmware::GenlockState;

/// The genlock guarantees 500 us; 10 % of it is the margin.
constexpr Duration kLockLimit = Duration::microseconds(450);
constexpr Duration kReportEvery = Duration::milliseconds(20);  ///< capture's report interval without events
constexpr int kNeutralChroma = 128;

/// The table of firmware/sync/genlock.h, written a second time: the allowed transitions.
bool may_follow(GenlockState from, GenlockState to) {
  switch (from) {
    case GenlockState::kOff: return to == GenlockState::kAcquiring || to == GenlockState::kLost;
    case GenlockState::kAcquiring: return to != GenlockState::kHoldover;
    case GenlockState::kLocked: return true;
    case GenlockState::kHoldover: return true;
    case GenlockState::kLost: return to != GenlockState::kHoldover;
  }
  return false;
}

/// The set's heads but for those whose JPEG is cut.
firmware::HeadMask decodable(const firmware::FrameSet& set) {
  firmware::HeadMask mask = set.mask;
  for (std::size_t i = 0; i < set.frames.size(); ++i) {
    if (!set.has(i)) continue;
    if (is_cut(set.frames[i].image)) mask &= static_cast<firmware::HeadMask>(~(1U << i));
  }
  return mask;
}

std::string of_head(std::size_t head) { return "head " + std::to_string(head) + ": "; }

}  // namespace

void Tally::add(const Tally& other) {
  for (auto member : {&Tally::events, &Tally::frames, &Tally::sets, &Tally::full_sets, &Tally::locked_sets,
                      &Tally::raymaps, &Tally::kills, &Tally::replies, &Tally::episodes, &Tally::storms,
                      &Tally::uploads, &Tally::never_came, &Tally::aligned_sets, &Tally::watched, &Tally::not_following,
                      &Tally::crowds, &Tally::good_answers, &Tally::good_refused, &Tally::good_dropped}) {
    this->*member += other.*member;
  }
  for (auto member : {&Tally::worst_locked_spread_ns, &Tally::slowest_alignment, &Tally::slowest_full_replug,
                      &Tally::slowest_full_recovery, &Tally::slowest_good}) {
    this->*member = std::max(this->*member, other.*member);
  }
  for (auto member : {&Tally::most_live, &Tally::most_left}) this->*member = std::max(this->*member, other.*member);
  for (std::size_t i = 0; i < hostile.size(); ++i) hostile[i] += other.hostile[i];
  for (auto member : {&Tally::slowest_replug, &Tally::slowest_recovery}) {
    (this->*member).ns = std::max((this->*member).ns, (other.*member).ns);
    (this->*member).periods = std::max((this->*member).periods, (other.*member).periods);
  }
  for (std::size_t s = 0; s < visited.size(); ++s) {
    for (std::size_t f = 0; f < visited[s].size(); ++f) {
      for (std::size_t m = 0; m < visited[s][f].size(); ++m) visited[s][f][m] += other.visited[s][f][m];
    }
  }
  for (std::size_t i = 0; i < rig_faults.size(); ++i) rig_faults[i] += other.rig_faults[i];
  for (std::size_t i = 0; i < losses.size(); ++i) losses[i] += other.losses[i];
}

Oracle::Oracle(World& world, const Nature& nature, Tally& tally)
    : world_(world),
      nature_(nature),
      tally_(tally),
      taken_before_(world.heads()),
      followed_(world.heads()),
      last_pulse_(world.heads()),
      last_serial_(world.heads()) {
  new_process();
}

void Oracle::fail(const std::string& what) {
  if (!failure_) failure_ = what;
}

void Oracle::new_process() {
  tally_.frames += counts_.frames;
  for (std::size_t i = 0; i < tally_.losses.size(); ++i) tally_.losses[i] += counts_.losses[i];
  counts_ = {};
  for (std::size_t i = 0; i < world_.heads(); ++i) taken_before_[i] = world_.head(i).counts().taken;
  last_set_.reset();
  not_taken_ = 0;
  last_trigger_.reset();
  genlock_ = GenlockState::kOff;
  remembered_.clear();
  first_exposed_.reset();
  ever_exposed_apart_ = false;
  full_since_.reset();
  whole_since_.reset();
}

void Oracle::begin_to_watch() {
  first_full_.reset();
  full_since_.reset();
  first_whole_.reset();
  whole_since_.reset();
  first_in_step_.reset();
  sets_ = whole_sets_ = 0;
}

void Oracle::on_set(const firmware::FrameSet& set, bool held_up) {
  if (failure_) return;
  trace(set.number);
  trace(static_cast<std::uint64_t>(set.mid_exposure.ns()));
  trace(set.mask | static_cast<std::uint64_t>(set.sync.state) << 32);
  trace(static_cast<std::uint64_t>(set.sync.spread.ns()));
  trace(static_cast<std::uint64_t>(set.sync.drift_ppb.value_or(0)));
  ++tally_.sets;
  ++sets_;
  if (last_set_ && set.number <= *last_set_) return fail("set " + std::to_string(set.number) + " follows a later one");
  last_set_ = set.number;
  if (set.mask == 0 || set.mask >> world_.heads() != 0) return fail("a set's mask names no head, or one there is not");
  // At most 2.5 periods after its middle, plus the daemon's wake-up interval.
  const Duration age = world_.now() - set.mid_exposure;
  if (!held_up && age > period() * 4 + nature_.look_every) {
    return fail("set " + std::to_string(set.number) + " was held for " + std::to_string(age.ms()) + " ms");
  }
  check_members(set);
  if (set.sync.state == GenlockState::kLocked) check_locked(set);
  const bool full = std::popcount(set.mask) == static_cast<int>(world_.heads());
  tally_.full_sets += full;
  const bool locked = set.sync.state == GenlockState::kLocked;
  const bool whole = full && (!world_.trigger().running() || locked);
  if (nature_.aligned && full && locked && !first_in_step_) first_in_step_ = world_.now();
  whole_sets_ += whole;
  const auto since = [&](bool is, std::optional<Instant>& first, std::optional<Instant>& ever_since) {
    if (!is) return ever_since.reset();
    if (!ever_since) ever_since = world_.now();
    if (!first) first = world_.now();
  };
  since(full, first_full_, full_since_);
  since(whole, first_whole_, whole_since_);
  constexpr std::size_t kRemembered = 64;
  remembered_[set.number] = {decodable(set), set.sync.trigger, set.mid_exposure, std::nullopt, exposed_alike(set)};
  if (remembered_.size() > kRemembered) remembered_.erase(remembered_.begin());
}

/// The blend uses a missing head's last known tone, which is known here only if no head ever changed its exposure.
bool Oracle::exposed_alike(const firmware::FrameSet& set) {
  std::optional<hal::HeadSettings> first;
  bool alike = true;
  for (std::size_t i = 0; i < world_.heads(); ++i) {
    if (!set.has(i)) continue;
    const hal::HeadSettings& in_effect = set.frames[i].in_effect;
    if (!first) first = in_effect;
    if (!first_exposed_) first_exposed_ = in_effect;
    alike = alike && in_effect == *first;
    ever_exposed_apart_ = ever_exposed_apart_ || !(in_effect == *first_exposed_);
  }
  const bool full = std::popcount(set.mask) == static_cast<int>(world_.heads());
  return full ? alike : !ever_exposed_apart_;
}

Duration Oracle::period() const {
  return world_.trigger().running() ? world_.trigger().period() : nature_.rate.period();
}

/// Each frame is as its head wrote it, newer than this head's previous one, and from the set's own trigger pulse.
void Oracle::check_members(const firmware::FrameSet& set) {
  std::optional<Instant> earliest, latest, said_earliest, said_latest;
  std::optional<PulseId> pulse;
  for (std::size_t i = 0; i < world_.heads(); ++i) {
    stamps_[i].reset();
    if (!set.has(i)) continue;
    const auto& frame = set.frames[i];
    const auto stamp = Stamp::read(frame.image);
    if (!stamp) return fail(of_head(i) + "its picture was overwritten while it was in a set");
    if (stamp->head != i)
      return fail(of_head(i) + "its frame in the set is head " + std::to_string(stamp->head) + "'s");
    if (stamp->serial <= last_serial_[i]) {
      return fail(of_head(i) + "exposure " + std::to_string(stamp->serial) + " is in a set after exposure " +
                  std::to_string(last_serial_[i]));
    }
    const bool next = stamp->pulse.epoch != 0 && stamp->serial == last_serial_[i] + 1 &&
                      stamp->pulse.number == last_pulse_[i] + 1 && set.sync.trigger;
    followed_[i] = next ? followed_[i] + 1 : 0;
    last_pulse_[i] = stamp->pulse.number;
    last_serial_[i] = stamp->serial;
    stamps_[i] = stamp;
    earliest = std::min(earliest.value_or(stamp->mid), stamp->mid);
    latest = std::max(latest.value_or(stamp->mid), stamp->mid);
    said_earliest = std::min(said_earliest.value_or(frame.mid_exposure), frame.mid_exposure);
    said_latest = std::max(said_latest.value_or(frame.mid_exposure), frame.mid_exposure);
    if (set.sync.offset[i] != frame.mid_exposure - set.mid_exposure) return fail(of_head(i) + "its offset is wrong");
    if (stamp->pulse.epoch == 0) continue;
    if (pulse && *pulse != stamp->pulse) {
      return fail(of_head(i) + "was exposed by pulse " + std::to_string(stamp->pulse.number) +
                  ", another head of set " + std::to_string(set.number) + " by pulse " + std::to_string(pulse->number));
    }
    pulse = stamp->pulse;
    if (set.sync.trigger && stamp->pulse.number != *set.sync.trigger) {
      return fail(of_head(i) + "was exposed by pulse " + std::to_string(stamp->pulse.number) + ", its set says " +
                  std::to_string(*set.sync.trigger));
    }
  }
  if (set.sync.spread != *said_latest - *said_earliest) return fail("a set's spread is not that of its frames");
  // Without a pulse, exposures a period or more apart cannot belong to one set.
  if (*latest - *earliest > period() * 5 / 4) {
    return fail("set " + std::to_string(set.number) + " mixes exposures " + std::to_string((*latest - *earliest).us()) +
                " us apart");
  }
  if (pulse && last_trigger_ && pulse->epoch == last_trigger_->epoch && pulse->number <= last_trigger_->number) {
    return fail("set " + std::to_string(set.number) + " is of an older pulse than the one before it");
  }
  if (pulse) last_trigger_ = pulse;
}

void Oracle::check_locked(const firmware::FrameSet& set) {
  ++tally_.locked_sets;
  std::optional<Instant> earliest, latest;
  for (std::size_t i = 0; i < world_.heads(); ++i) {
    if (!stamps_[i]) continue;
    const Instant when = nature_.aligned ? stamps_[i]->mid : stamps_[i]->begin - nature_.head[i].delay;
    earliest = std::min(earliest.value_or(when), when);
    latest = std::max(latest.value_or(when), when);
  }
  if (nature_.aligned) {
    ++tally_.aligned_sets;
  } else if (!set.sync.trigger || !set.sync.begin_spread) {
    return fail("a set is called locked that names no pulse");
  }
  const Duration spread = *latest - *earliest;
  tally_.worst_locked_spread_ns = std::max(tally_.worst_locked_spread_ns, spread.ns());
  if (spread > kLockLimit || set.sync.begin_spread.value_or(set.sync.spread) > kLockLimit) {
    fail("set " + std::to_string(set.number) + " is called locked and its exposures were " +
         std::to_string(spread.us()) + " us apart");
  }
}

void Oracle::after_event(firmware::Rig& rig, std::optional<Instant> captured) {
  ++tally_.events;
  if (failure_) return;
  check_books(rig);
  check_genlock(rig, captured);
  check_wired(rig.capture().report().genlock);
}

void Oracle::check_wired(const firmware::GenlockReport& genlock) {
  // A drift is forgotten after this many exposures that follow, a skipped pulse after a few.
  constexpr int kForgotten = 600, kSkipForgotten = 3;
  for (std::size_t i = 0; i < world_.heads(); ++i) {
    const firmware::Following state = genlock.wired[i].state;
    if (state == firmware::Following::kUnknown) continue;
    ++tally_.watched;
    if (state == firmware::Following::kFollows) continue;
    ++tally_.not_following;
    if (followed_[i] > (state == firmware::Following::kDrifts ? kForgotten : kSkipForgotten)) {
      return fail(of_head(i) + "is reported not to follow the pulses, which started its last " +
                  std::to_string(followed_[i]) + " exposures; drift " + std::to_string(genlock.wired[i].drift_ppb));
    }
  }
}

/// frames = in sets + held + lost, and frames are those that the heads delivered; nothing waits longer than allowed.
void Oracle::check_books(firmware::Rig& rig) {
  const firmware::CaptureReport& report = rig.capture().report();
  counts_ = {};
  for (std::size_t i = 0; i < world_.heads(); ++i) {
    const firmware::FrameCounts& counts = report.heads[i].counts;
    const std::uint64_t taken = world_.head(i).counts().taken - taken_before_[i];
    if (counts.frames != taken || counts.frames != counts.in_sets + counts.held + counts.lost()) {
      return fail(of_head(i) + std::to_string(taken) + " frames were taken, " + std::to_string(counts.in_sets) +
                  " are in sets, " + std::to_string(counts.held) + " held, " + std::to_string(counts.lost()) + " lost");
    }
    if (counts.held > firmware::Capture::kMaxOpenSets)
      return fail(of_head(i) + "more of its frames are held than sets");
    counts_.add(counts);
  }
  if (rig.control().clients() > firmware::Admission::in_all(firmware::Admission::kMaxLinks))
    return fail("more hosts are served than allowed");
}

void Oracle::check_genlock(firmware::Rig& rig, std::optional<Instant> captured) {
  const GenlockState state = rig.capture().report().genlock.state;
  if (sets_made_ != rig.capture().report().sets) last_set_at_ = world_.now();
  sets_made_ = rig.capture().report().sets;
  if (state != genlock_) {
    trace(static_cast<std::uint64_t>(state));
    if (!may_follow(genlock_, state)) {
      return fail("the genlock went from " + std::string(genlock_state_name(genlock_)) + " to " +
                  std::string(genlock_state_name(state)));
    }
    genlock_ = state;
  }
  if (!captured || state != GenlockState::kLocked) return;
  const Trigger& trigger = world_.trigger();
  if (nature_.aligned) {
    if (*captured - last_set_at_ <= period() * 3 + nature_.look_every + kReportEvery) return;
    return fail("the heads are called in step " + std::to_string((*captured - last_set_at_).ms()) +
                " ms after the last set");
  }
  if (*captured - trigger.newest_seen() > trigger.period() * 3 + nature_.look_every) {
    fail("the genlock is called locked " + std::to_string((*captured - trigger.newest_seen()).ms()) +
         " ms after the last pulse");
  }
}

void Oracle::check_field(const wire::RaymapHeader& header, Instant set_mid) {
  const bool interlaced = nature_.fields != Fields::kProgressive;
  Instant expected = set_mid;
  if (interlaced && header.field() == 1) expected = expected + nature_.rate.period() / 2;
  if (header.has_field() != interlaced || header.field() > 1 ||
      header.mid_exposure_ns() != static_cast<std::uint64_t>(expected.ns())) {
    return fail("raymap of set " + std::to_string(header.set()) + " is not of its fields, or not of their time");
  }
  if (!interlaced) return;
  const FieldParity first = first_field(nature_.fields);
  const FieldParity expected_parity = header.field() == 0 ? first : other(first);
  if (header.parity() != field_parity_name(expected_parity)) {
    fail("raymap of set " + std::to_string(header.set()) + " has its fields in the wrong order");
  }
}

void Oracle::on_raymap(const wire::RaymapHeader& header, const std::vector<std::uint8_t>& pixels,
                       const std::array<Sha256, kCalibrations>& ids) {
  if (failure_) return;
  ++tally_.raymaps;
  trace(header.set());
  const auto set = remembered_.find(header.set());
  if (set != remembered_.end()) {
    const bool same_trigger = header.has_trigger() == set->second.trigger.has_value() &&
                              (!header.has_trigger() || header.trigger() == *set->second.trigger);
    if ((header.heads_mask() & ~set->second.decodable) != 0 || !same_trigger) {
      return fail("raymap of set " + std::to_string(header.set()) + " tells of another set");
    }
    check_field(header, set->second.mid);
  }
  std::optional<int> which;
  for (int i = 0; i < kCalibrations; ++i) {
    if (header.calibration_id() == sha256_to_wire(ids[static_cast<std::size_t>(i)])) which = i;
  }
  if (!which) return fail("a raymap names a calibration that nobody uploaded");
  if (set == remembered_.end()) return;
  if (set->second.made_by.value_or(*which) != *which) {
    return fail("the raymaps of set " + std::to_string(header.set()) + " are made by two calibrations");
  }
  set->second.made_by = which;
  if (!set->second.exposed_alike) return;
  const int expected = *which == 0 ? kPictureLevel : kPictureLevel / 2;
  const std::size_t grey = has_chroma(nature_.raymap) ? std::size_t{header.width()} * header.height() : pixels.size();
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const int sample = i < grey ? expected : kNeutralChroma;
    if ((i < grey && pixels[i] == 0) || (pixels[i] >= sample - 1 && pixels[i] <= sample + 1)) continue;
    return fail("raymap of set " + std::to_string(header.set()) + " names calibration " + std::to_string(*which) +
                " and holds " + std::to_string(pixels[i]) + ", not " + std::to_string(sample));
  }
}

}  // namespace nodal::swarm
