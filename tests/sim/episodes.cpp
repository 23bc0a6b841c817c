// The part of Swarm that plans the faults and measures the recovery times.
#include <algorithm>

#include "tests/sim/swarm.h"

namespace nodal::swarm {

void Swarm::plan_next(Duration after) { world_.queue().plan(world_.now() + after, EventKind::kPlan); }

void Swarm::advance_episode() {
  switch (phase_) {
    case Phase::kCalm:
      draw_episode();
      phase_ = Phase::kPrepared;
      prepare();
      return;
    case Phase::kPrepared:
      phase_ = Phase::kFaulty;
      ++outcome_.tally.episodes;
      if (episode_.of_clients) begin_crowd();
      else if (episode_.of_heads) begin_head_fault();
      else begin_rig_fault();
      return;
    case Phase::kFaulty:
      phase_ = Phase::kRecovering;
      end_faults();
      plan_next(std::max(recover_within_ + std::max(Duration::seconds(1), periods(8)),
                         nature_.can_align ? periods(kPeriodsToAlign + 8) : Duration()));
      return;
    case Phase::kRecovering:
      check_recovery();
      if (oracle_.failure()) return;
      phase_ = Phase::kCalm;
      plan_next(drawn(Duration::milliseconds(50), Duration::milliseconds(800)));
      return;
  }
}

void Swarm::draw_episode() {
  episode_ = {};
  if (nature_.hostile && (options_.hostile || crowds_.chance(300'000))) {
    episode_.of_clients = true;
    return;
  }
  episode_.of_heads = random_.chance(700'000);
  episode_.head_fault = static_cast<HeadFault>(random_.below(kHeadFaults));
  episode_.rig_fault = static_cast<RigFault>(random_.below(kRigFaults));
  episode_.state = static_cast<HeadState>(random_.below(kHeadStates));
  episode_.many = static_cast<HowMany>(random_.below(kHowMany));
  std::vector<std::size_t> all(world_.heads());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  for (std::size_t i = all.size(); i > 1; --i) std::swap(all[i - 1], all[random_.below(i)]);
  const std::size_t many = episode_.many == HowMany::kOne ? 1 : episode_.many == HowMany::kTwo ? 2 : all.size();
  episode_.heads.assign(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(many, all.size())));
}

/// Brings the heads to the drawn state; the fault begins when they are about there.
void Swarm::prepare() {
  if (episode_.of_clients) {
    crowd_ = std::make_unique<Crowd>(*listener_, oracle_, documents_, outcome_.tally, crowds_.next(), *rig_, *disk_,
                                     world_.now());
    return plan_next(Duration::seconds(1));
  }
  if (!episode_.of_heads) {
    if (random_.chance(100'000)) host().genlock(genlocked_ = !genlocked_);
    return plan_next(drawn(Duration::milliseconds(20), Duration::seconds(1)));
  }
  switch (episode_.state) {
    case HeadState::kAway:
      for (const std::size_t i : episode_.heads) world_.head(i).unplug();
      return plan_next(drawn(Duration::milliseconds(20), Duration::milliseconds(600)));
    case HeadState::kStarting:
      for (const std::size_t i : episode_.heads) {
        world_.head(i).unplug();
        world_.head(i).replug();
      }
      return plan_next(drawn(Duration::milliseconds(200), Duration::milliseconds(230)) + periods(1) / 2);
    case HeadState::kSilent:
      for (const std::size_t i : episode_.heads) world_.head(i).lose(40);
      return plan_next(periods(12));
    case HeadState::kFree:
    case HeadState::kTriggered:
      if (genlocked_ != (episode_.state == HeadState::kTriggered)) {
        genlocked_ = !genlocked_;
        host().genlock(genlocked_);
      }
      return plan_next(periods(10) + drawn(Duration::milliseconds(100), Duration::milliseconds(1000)));
  }
}

HeadState Swarm::state_of(std::size_t head) {
  const Head& its = world_.head(head);
  if (!its.present() || !its.is_open()) return HeadState::kAway;
  const firmware::HeadReport& report = rig_->capture().report().heads[head];
  if (!its.streaming() || world_.now() - its.started() < periods(1)) return HeadState::kStarting;
  if (episode_.state == HeadState::kSilent && report.missing_sets > 0) return HeadState::kSilent;
  return its.triggered() ? HeadState::kTriggered : HeadState::kFree;
}

void Swarm::begin_head_fault() {
  const auto at = static_cast<std::size_t>(state_of(episode_.heads.front()));
  ++outcome_.tally.visited[at][static_cast<std::size_t>(episode_.head_fault)][static_cast<std::size_t>(episode_.many)];
  const int frames = 1 + static_cast<int>(random_.below(random_.chance(300'000) ? 40 : 4));
  Duration lasts = drawn(periods(2), periods(2) + Duration::seconds(2));
  if (episode_.head_fault == HeadFault::kDeaf) lasts = lasts * static_cast<std::int64_t>(1 + random_.below(12));
  const bool ahead = random_.chance(500'000);
  for (const std::size_t i : episode_.heads) {
    Head& head = world_.head(i);
    switch (episode_.head_fault) {
      case HeadFault::kLose: head.lose(frames); break;
      case HeadFault::kCorrupt: head.corrupt(frames); break;
      case HeadFault::kTear: head.tear(frames); break;
      case HeadFault::kNoSignal: head.set_signal(false); break;
      case HeadFault::kDuplicate: head.duplicate(frames); break;
      case HeadFault::kLate: head.delay(frames, drawn(Duration::milliseconds(1), periods(5))); break;
      case HeadFault::kStall: head.stall(lasts); break;
      case HeadFault::kUnplug: head.unplug(); break;
      case HeadFault::kWrongSize: head.resize(frames); break;
      case HeadFault::kStuckExposure: head.set_stuck(true); break;
      case HeadFault::kSequenceWraps: head.set_sequence(0xfffffffeU); break;
      case HeadFault::kStartsAtZero: head.set_sequence(0); break;
      // A 32-bit microsecond counter that wraps, in either direction, or any other jump.
      case HeadFault::kTimeWraps: {
        const Duration off = random_.chance(500'000) ? Duration::microseconds(std::int64_t{1} << 32)
                                                     : drawn(Duration::seconds(10), Duration::seconds(1000));
        head.set_clock_error(ahead ? off : -off);
        break;
      }
      case HeadFault::kMissesPulses: head.miss_pulses(frames); break;
      case HeadFault::kDeaf:
        if (head.wired() && wiring_.chance(333'333)) head.set_half_rate(true);
        else head.set_deaf(true);
        break;
    }
  }
  replugged_ = episode_.head_fault == HeadFault::kUnplug;
  recover_within_ = replugged_ ? std::max(kWithinReplug, periods(kPeriodsWithinReplug))
                               : std::max(kWithinFaults, periods(kPeriodsWithinFaults));
  plan_next(lasts);
}

void Swarm::begin_storm() {
  ++outcome_.tally.storms;
  FrameFaults storm;
  for (auto member : {&FrameFaults::lose, &FrameFaults::corrupt, &FrameFaults::tear, &FrameFaults::duplicate,
                      &FrameFaults::late, &FrameFaults::wrong_size, &FrameFaults::miss_pulse}) {
    if (random_.chance(500'000)) storm.*member = static_cast<std::uint32_t>(random_.below(80'000));
  }
  storm.longest_late = drawn(Duration::milliseconds(2), periods(6));
  for (std::size_t i = 0; i < world_.heads(); ++i) {
    if (random_.chance(700'000)) world_.head(i).set_storm(storm);
    if (random_.chance(50'000)) world_.head(i).unplug();
  }
  if (random_.chance(500'000)) world_.trigger().lose(static_cast<int>(random_.below(10)));
  if (random_.chance(500'000)) host().genlock(genlocked_ = !genlocked_);
}

void Swarm::begin_crowd() {
  crowd_->attack();
  replugged_ = false;
  recover_within_ = std::max(kWithinFaults, periods(kPeriodsWithinFaults));
  constexpr std::uint64_t kShortestMs = 3'000, kLongestMs = 25'000;
  plan_next(Duration::milliseconds(static_cast<std::int64_t>(kShortestMs + crowds_.below(kLongestMs - kShortestMs))));
}

void Swarm::begin_rig_fault() {
  ++outcome_.tally.rig_faults[static_cast<std::size_t>(episode_.rig_fault)];
  replugged_ = false;
  recover_within_ = std::max(kWithinFaults, periods(kPeriodsWithinFaults));
  Duration lasts = drawn(Duration::milliseconds(20), Duration::seconds(2));
  const Instant until = world_.now() + lasts;
  const int pulses = 1 + static_cast<int>(random_.below(20));
  switch (episode_.rig_fault) {
    case RigFault::kPulsesMissing: world_.trigger().lose(pulses); break;
    case RigFault::kPulsesUnseen: world_.trigger().hide(pulses); break;
    case RigFault::kPulsesExtra: world_.trigger().send_extra(); break;
    case RigFault::kTriggerDrifts: world_.trigger().set_drift(100'000 - 2 * nature_.trigger.drift_ppb); break;
    case RigFault::kTriggerGone: world_.trigger().unplug(); break;
    case RigFault::kClockStep: step_clock(lasts * 3); break;
    case RigFault::kSuspend: world_.clock().advance(lasts * 5); break;
    case RigFault::kCaptureStalls: capture_until_ = until; break;
    case RigFault::kBlendStalls: blend_until_ = until; break;
    case RigFault::kKeeperStalls: keeper_until_ = until; break;
    case RigFault::kControlStalls: control_until_ = until; break;
    case RigFault::kDiskFull:
      disk_->set_capacity(random_.below(6000));
      host().act();
      break;
    case RigFault::kDiskFails:
      for (int i = 0; i < 3; ++i) disk_->fail_at(disk_->operations() + random_.below(12));
      break;
    case RigFault::kDiskSlow: disk_->be_slow(&world_.clock(), drawn({}, Duration::milliseconds(30))); break;
    case RigFault::kKilled:
    case RigFault::kPowerLoss: end_process(episode_.rig_fault == RigFault::kPowerLoss); break;
    case RigFault::kStorm:
      begin_storm();
      lasts = lasts * 5;
      break;
    default: begin_link_fault(); break;
  }
  plan_next(lasts);
}

void Swarm::begin_link_fault() {
  Host& its = host();
  switch (episode_.rig_fault) {
    case RigFault::kLinkSplit: its.split(1 + static_cast<std::uint32_t>(random_.below(9))); break;
    case RigFault::kLinkReset: its.reset(); break;
    case RigFault::kLinkStalls: its.stall(true); break;
    case RigFault::kLinkReplays: its.replay(); break;
    case RigFault::kLinkFlips: its.flip_bit(); break;
    default: its.leave_mid_upload(); break;
  }
  if (episode_.rig_fault != RigFault::kHostGoneMidUpload) its.act();
}

void Swarm::end_faults() {
  for (std::size_t i = 0; i < world_.heads(); ++i) world_.head(i).forget_faults();
  world_.trigger().forget_faults();
  world_.trigger().set_drift(nature_.trigger.drift_ppb);
  capture_until_ = blend_until_ = keeper_until_ = control_until_ = Instant();
  disk_->set_capacity(std::uint64_t{1} << 40);
  disk_->be_slow(nullptr, {});
  for (const auto& each : hosts_) {
    each->split(0);
    each->stall(false);
  }
  if (crowd_) crowd_->leave();
  if (!episode_.of_clients && !episode_.of_heads && episode_.rig_fault == RigFault::kTriggerGone) {
    world_.trigger().replug();
    end_process(false);  // as its message requests: restart nodald when the store is back
  }
  faults_ended_ = world_.now();
  oracle_.begin_to_watch();
}

void Swarm::check_recovery() {
  if (crowd_) crowd_->check_end();
  crowd_.reset();
  if (oracle_.failure()) return;
  const std::optional<Instant> first = oracle_.first_whole();
  const std::optional<Instant> since = oracle_.whole_since();
  const bool genlocked = world_.trigger().running();
  if (!first || (genlocked && !since)) return oracle_.fail("the rig does not make whole sets any more");
  // A free-running rig is never permanently in step: a head whose clock is slow relative to the others must miss a set
  // now and then. So it counts as recovered if it is in step most of the time; a genlocked rig must stay in step.
  const std::int64_t full = ((genlocked ? *oracle_.full_since() : *oracle_.first_full()) - faults_ended_).ns();
  std::int64_t& slowest_full = replugged_ ? outcome_.tally.slowest_full_replug : outcome_.tally.slowest_full_recovery;
  slowest_full = std::max(slowest_full, full);
  if (full > (replugged_ ? kWithinReplug : kWithinFaults).ns()) {
    return oracle_.fail("full sets again only " + std::to_string(full / 1'000'000) + " ms after the faults ended");
  }
  const std::int64_t took = ((genlocked ? *since : *first) - faults_ended_).ns();
  Recovery& slowest = replugged_ ? outcome_.tally.slowest_replug : outcome_.tally.slowest_recovery;
  slowest.ns = std::max(slowest.ns, took);
  slowest.periods = std::max(slowest.periods, took / periods(1).ns());
  if (took > recover_within_.ns()) {
    return oracle_.fail("whole sets again only " + std::to_string(took / 1'000'000) + " ms after the faults ended");
  }
  // A head that settles one period earlier or later than it was counted costs one set, once: at most a fifth of them.
  const std::uint64_t whole =
      oracle_.whole_sets_since() + std::min<std::uint64_t>(world_.heads(), oracle_.sets_since() / 5);
  if (!genlocked && oracle_.sets_since() > 8 && whole * 10 < oracle_.sets_since() * 7) {
    return oracle_.fail("after the faults ended only " + std::to_string(oracle_.whole_sets_since()) + " of " +
                        std::to_string(oracle_.sets_since()) + " sets were whole");
  }
  if (nature_.can_align && !oracle_.genlock_is_off()) check_alignment();
}

/// A head's clock is estimated from frames, so a slow rig takes more seconds.
void Swarm::check_alignment() {
  const std::optional<Instant> in_step = oracle_.first_in_step();
  if (!in_step) return oracle_.fail("the heads are not in step any more");
  const std::int64_t took = (*in_step - faults_ended_).ns() / periods(1).ns();
  outcome_.tally.slowest_alignment = std::max(outcome_.tally.slowest_alignment, took);
  if (took > kPeriodsToAlign) oracle_.fail("in step again only " + std::to_string(took) + " periods after the faults");
}

}  // namespace nodal::swarm
