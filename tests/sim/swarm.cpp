#include "tests/sim/swarm.h"

#include "firmware/calibration/calibration_store.h"

namespace nodal::swarm {
namespace {

constexpr Duration kHostsAct = Duration::milliseconds(1300);
constexpr int kStepsALook = 16;  ///< steps of control, which continues at once while it has work

bool has_cut_picture(const firmware::FrameSet& set) {
  for (std::size_t i = 0; i < set.frames.size(); ++i) {
    if (set.has(i) && is_cut(set.frames[i].image)) return true;
  }
  return false;
}

}  // namespace

Swarm::Swarm(std::uint64_t seed, const DrawOptions& options)
    : options_(options),
      nature_(draw_nature(seed, options)),
      random_(seed, "plan"),
      world_(nature_),
      oracle_(world_, nature_, outcome_.tally),
      config_(config_of(nature_)),
      disk_(std::make_unique<hal::sim::SimDisk>(seed)),
      wiring_(seed, "wiring faults"),
      crowds_(seed, "crowds"),
      genlocked_(nature_.genlocked) {
  for (int i = 0; i < kCalibrations; ++i) {
    const Calibration calibration = calibration_of(nature_, i);
    documents_.json[static_cast<std::size_t>(i)] = canonical_json(calibration);
    documents_.id[static_cast<std::size_t>(i)] = calibration_id(calibration);
  }
  // The first calibration is in force as if it had been uploaded before.
  auto store = firmware::CalibrationStore::open(*disk_);
  const bool stored = store && store->put(calibration_of(nature_, 0)) && store->set_in_force(documents_.id[0]);
  NODAL_ASSERT(stored);
  documents_.sure = 0;
  start_process();
}

Swarm::~Swarm() {
  hosts_.clear();
  crowd_.reset();
  reader_.reset();
  rig_.reset();
}

Outcome Swarm::run(Duration how_long) {
  end_ = world_.now() + how_long;
  if (options_.faults) plan_next(Duration::seconds(3));
  if (nature_.hosts) world_.queue().plan(world_.now() + kHostsAct, EventKind::kHost);
  while (!oracle_.failure()) {
    const Event event = world_.queue().next();
    if (event.at > end_) break;
    // The rig's own work may have taken time (a slow disk); the world did not wait for it.
    if (event.at > world_.now()) world_.clock().advance_to(event.at);
    handle(event);
  }
  if (!oracle_.failure() && rig_) {
    hosts_.clear();
    crowd_.reset();
    reader_.reset();
    rig_->close();
    oracle_.after_event(*rig_, std::nullopt);
  }
  oracle_.new_process();  // adds the old process's counters to the sums
  for (std::size_t i = 0; i < world_.heads(); ++i) outcome_.tally.never_came += world_.head(i).counts().lost;
  if (oracle_.failure()) outcome_.failure = where() + *oracle_.failure();
  outcome_.trace = oracle_.trace();
  return outcome_;
}

std::string Swarm::where() const {
  std::string text = std::to_string(nature_.heads) + " heads at " + std::to_string(nature_.rate.numerator) + "/" +
                     std::to_string(nature_.rate.denominator) + " Hz, " +
                     std::to_string(const_cast<World&>(world_).now().ns() / 1'000) + " us, ";
  if (phase_ == Phase::kCalm) return text + "calm: ";
  text += phase_ == Phase::kRecovering ? "after " : phase_ == Phase::kPrepared ? "before " : "in ";
  if (episode_.of_clients) return text + "'hostile clients': ";
  if (!episode_.of_heads) return text + "'" + std::string(name_of(episode_.rig_fault)) + "': ";
  return text + "'" + std::string(name_of(episode_.head_fault)) + "' of " + std::string(name_of(episode_.many)) + " " +
         std::string(name_of(episode_.state)) + ": ";
}

void Swarm::handle(const Event& event) {
  switch (event.kind) {
    case EventKind::kPulse:
    case EventKind::kExpose:
    case EventKind::kArrive:
      if (world_.on_event(event)) plan_step(world_.now());
      break;
    case EventKind::kStep:
      if (event.at == next_step_) step(world_.now());
      break;
    case EventKind::kHost: act_hosts(); break;
    case EventKind::kPlan: advance_episode(); break;
  }
}

/// Devices send no events: the daemon finds frames at its next wake-up.
void Swarm::plan_step(Instant at) {
  const std::int64_t poll = nature_.poll.ns();
  const Instant tick = std::min(Instant::from_ns((at.ns() + poll - 1) / poll * poll), std::max(at, next_look_));
  if (next_step_ >= at && next_step_ <= tick) return;
  next_step_ = tick;
  world_.queue().plan(tick, EventKind::kStep);
}

void Swarm::step(Instant now) {
  const bool capture_runs = now >= capture_until_;
  if (capture_runs) {
    rig_->step_capture();
    look_at_set();
  }
  if (now >= blend_until_) {
    while (rig_->step_blend()) {}
    while (rig_->step_encode()) {}
  }
  if (reader_) {  // before control, which frees slots in the publisher's outlet that the encoder uses in the next step
    if (auto wrong = reader_->step(now)) oracle_.fail(std::move(*wrong));
  }
  if (now >= next_look_) {
    next_look_ = now + nature_.look_every;
    step_rest(now);
  }
  oracle_.trace(static_cast<std::uint64_t>(now.ns()));
  oracle_.after_event(*rig_, capture_runs ? std::optional(now) : std::nullopt);
  plan_step(world_.now() + Duration::nanoseconds(1));
}

void Swarm::step_rest(Instant now) {
  if (now >= keeper_until_) rig_->step_keeper();
  if (now < control_until_) return;
  for (const auto& host : hosts_) host->pump();
  if (crowd_) crowd_->act(now);
  for (int steps = crowd_ ? kStepsALook : 1; steps > 0 && rig_->step_control(); --steps) {}
  for (const auto& host : hosts_) host->pump();
  const std::vector<std::string> news = rig_->control().take_news();
  if (crowd_ && phase_ != Phase::kRecovering) {
    crowd_->on_news(news);
    crowd_->check(now);
  }
}

/// Between capture and blend. Most sets are returned here, because blending all of them would dominate the run time.
void Swarm::look_at_set() {
  firmware::Outlet<firmware::SetLoan>& out = rig_->blender().sets_in();
  const bool kept_waiting = world_.now() < blend_until_;
  std::vector<firmware::SetLoan> kept;  // the others are returned at the end of this function
  while (const auto set = out.take()) {
    if (!looked_at_ || (*set)->number > *looked_at_) {
      looked_at_ = (*set)->number;
      oracle_.on_set(**set, held_up());
    }
    const bool blended =
        (*set)->number % static_cast<std::uint64_t>(nature_.blend_every) == 0 || has_cut_picture(**set);
    if (kept_waiting || crowd_ || blended) kept.push_back(*set);
  }
  for (const firmware::SetLoan& set : kept) out.offer(set);
}

bool Swarm::held_up() const {
  if (phase_ != Phase::kFaulty && phase_ != Phase::kRecovering) return false;
  if (episode_.of_clients) return false;
  if (episode_.of_heads) return episode_.head_fault == HeadFault::kLate || episode_.head_fault == HeadFault::kStall;
  switch (episode_.rig_fault) {
    case RigFault::kClockStep:
    case RigFault::kSuspend:
    case RigFault::kCaptureStalls:
    case RigFault::kBlendStalls:
    case RigFault::kDiskSlow:
    case RigFault::kStorm: return true;
    default: return false;
  }
}

void Swarm::start_process() {
  listener_ = std::make_unique<hal::sim::SimLinkListener>();
  watchdog_ = std::make_unique<hal::sim::SimWatchdog>(world_.clock());
  rig_ = std::make_unique<firmware::Rig>(config_,
                                         firmware::RigPorts{world_.clock(),
                                                            world_.enumerator(),
                                                            &world_.trigger(),
                                                            *disk_,
                                                            {{listener_.get()}},
                                                            watchdog_.get(),
                                                            {},
                                                            nullptr},
                                         "a swarm");
  if (nature_.reader) reader_ = std::make_unique<SecondReader>(*rig_, *nature_.reader, nature_.seed);
  looked_at_.reset();
  oracle_.new_process();
  genlocked_ = nature_.genlocked;
  next_look_ = world_.now();
  plan_step(world_.now());
}

/// Killed at any point; afterwards the calibration in force must be the reported one, or the one being installed.
void Swarm::end_process(bool power_lost) {
  ++outcome_.tally.kills;
  hosts_.clear();
  reader_.reset();
  rig_.reset();
  disk_ = power_lost ? disk_->after_power_loss(random_.next()) : disk_->after_kill();
  auto store = firmware::CalibrationStore::open(*disk_);
  if (!store) return oracle_.fail("after a crash the store cannot be opened: " + store.error().text());
  bool allowed = !store->in_force() && !documents_.sure;
  for (int i = 0; i < kCalibrations; ++i) {
    const bool known = documents_.sure == i || documents_.maybe[static_cast<std::size_t>(i)];
    allowed |= known && store->in_force() == documents_.id[static_cast<std::size_t>(i)];
    if (known && store->in_force() == documents_.id[static_cast<std::size_t>(i)]) documents_.sure = i;
  }
  if (!allowed) return oracle_.fail("after a crash a calibration is in force that was not before, or none is");
  documents_.maybe = {};
  start_process();
}

void Swarm::step_clock(Duration by) {
  world_.step_clock(by);
  next_step_ = next_step_ + by;
  next_look_ = next_look_ + by;
}

Host& Swarm::host() {
  std::erase_if(hosts_, [](const auto& host) { return host->dead(); });
  if (hosts_.empty()) {
    hosts_.push_back(
        std::make_unique<Host>(*listener_, oracle_, documents_, outcome_.tally, nature_.seed + 1000 * ++hosts_made_));
  }
  return *hosts_[random_.below(hosts_.size())];
}

void Swarm::act_hosts() {
  world_.queue().plan(world_.now() + drawn(kHostsAct / 4, kHostsAct * 2), EventKind::kHost);
  if (crowd_) return;
  if (hosts_.size() < 3 && random_.chance(200'000)) {
    hosts_.push_back(
        std::make_unique<Host>(*listener_, oracle_, documents_, outcome_.tally, nature_.seed + 1000 * ++hosts_made_));
  }
  host().act();
}

Duration Swarm::drawn(Duration least, Duration most) {
  return least + Duration::nanoseconds(
                     static_cast<std::int64_t>(random_.below(static_cast<std::uint64_t>((most - least).ns()) + 1)));
}

}  // namespace nodal::swarm
