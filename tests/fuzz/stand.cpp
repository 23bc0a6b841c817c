#include "tests/fuzz/stand.h"

#include <algorithm>

#include "firmware/calibration/calibration_store.h"
#include "firmware/storage/settings_store.h"
#include "tests/fuzz/live_heap.h"

namespace nodal::fuzz {
namespace {

constexpr Duration kTick = Duration::milliseconds(50);        ///< how often the rig is stepped when nothing happens
constexpr Duration kWarmUp = Duration::milliseconds(150);     ///< one frame set
constexpr Duration kConverge = Duration::milliseconds(1500);  ///< settings are on disk, and heads have applied them
constexpr Duration kWatch = Duration::seconds(2);
constexpr std::int64_t kEventsOfACheck = 2500;
constexpr std::int64_t kMaxUploaded = 16 << 20;  ///< incomplete uploads, and generations on the disk

const swarm::Nature& nature() {
  static const swarm::Nature made = [] {
    swarm::Nature two;
    two.heads = 2;
    two.rate = FrameRate{10, 1};
    two.head.resize(2);
    for (swarm::HeadNature& head : two.head) {
      head.rate = two.rate;
      head.control_latency = 1;
    }
    return two;
  }();
  return made;
}

}  // namespace

void write_file(hal::sim::SimDisk& disk, const std::string& name, std::span<const std::uint8_t> bytes) {
  (void)disk.remove(name);
  const auto file = disk.create(name);
  if (!file) return;  // a folder has this name, or it is none for a file
  (void)disk.write(*file, bytes);
  (void)disk.sync(*file);
  disk.close(*file);
}

const firmware::RigConfig& Stand::config() {
  static const firmware::RigConfig made = swarm::config_of(nature());
  return made;
}

const std::array<Calibration, swarm::kCalibrations>& Stand::calibrations() {
  static const std::array made{swarm::calibration_of(nature(), 0), swarm::calibration_of(nature(), 1)};
  return made;
}

std::unique_ptr<hal::sim::SimDisk> Stand::new_disk() {
  static const auto made = [] {
    auto disk = std::make_unique<hal::sim::SimDisk>();
    auto store = firmware::CalibrationStore::open(*disk);
    const bool stored =
        store && store->put(calibrations()[0]) && store->set_in_force(calibration_id(calibrations()[0]));
    NODAL_ASSERT(stored);
    return disk;
  }();
  return made->after_kill();
}

Stand::Stand(std::unique_ptr<hal::sim::SimDisk> disk)
    : heap_before_(live_heap_bytes()), world_(nature()), disk_(std::move(disk)) {
  start();
  run(kWarmUp);
  wire::Request request;
  request.mutable_status();
  ask(connect(), request);
  leave_all();
  heap_steady_ = live_heap_bytes() - heap_before_;
}

Stand::~Stand() {
  guests_.clear();
  vandals_.clear();
  rig_->close();
  check_conserved();
}

void Stand::start() {
  taken_before_.clear();
  for (std::size_t i = 0; i < world_.heads(); ++i) taken_before_.push_back(world_.head(i).counts().taken);
  listener_ = std::make_unique<hal::sim::SimLinkListener>();
  watchdog_ = std::make_unique<hal::sim::SimWatchdog>(world_.clock());
  rig_ = std::make_unique<firmware::Rig>(config(),
                                         firmware::RigPorts{world_.clock(),
                                                            world_.enumerator(),
                                                            &world_.trigger(),
                                                            *disk_,
                                                            {{listener_.get()}},
                                                            watchdog_.get(),
                                                            {},
                                                            nullptr},
                                         "a fuzzed rig");
  log_bytes_ = 0;
  started_ = world_.now();
}

void Stand::settle() {
  for (int turn = 0; turn < kTurnsToRest; ++turn) {
    bool busy = rig_->step_all();
    for (const auto& guest : guests_) busy |= guest->pump();
    for (const auto& vandal : vandals_) busy |= vandal->pump();
    if (!busy) return;
  }
  NODAL_ASSERT(false && "the rig comes to rest while time stands still");
}

void Stand::run(Duration duration) {
  const Instant end = world_.now() + duration;
  std::int64_t events = 0, at_once = 0;
  const std::int64_t most = kEventsAtOnce + kEventsASecond * (duration.ms() + 1) / 1000;
  world_.queue().plan(std::min(world_.now() + kTick, end), swarm::EventKind::kStep);
  for (Instant now = world_.now(); now < end;) {
    if (events_left_-- <= 0) {
      jump(end - now);
      break;
    }
    const swarm::Event event = world_.queue().next();
    if (event.at > now) at_once = 0;
    ++events;
    ++at_once;
    NODAL_ASSERT(events <= most && at_once <= kEventsAtOnce);  // otherwise virtual time would not advance
    if (event.at > now) {
      served_ = served_ + (event.at - now);
      now = event.at;
      world_.clock().advance_to(now);
    }
    if (event.kind == swarm::EventKind::kStep) {
      settle();
      if (now < end) world_.queue().plan(std::min(now + kTick, end), swarm::EventKind::kStep);
    } else if (world_.on_event(event)) {
      settle();
    }
  }
}

void Stand::jump(Duration by) {
  world_.step_clock(by);
  settle();
}

Guest& Stand::connect() {
  guests_.push_back(std::make_unique<Guest>(*listener_, "a guest"));
  settle();
  return *guests_.back();
}

Vandal& Stand::intrude() {
  vandals_.push_back(std::make_unique<Vandal>(*listener_));
  settle();
  return *vandals_.back();
}

void Stand::leave_all() {
  guests_.clear();
  vandals_.clear();
  settle();
}

wire::Reply Stand::ask(Guest& guest, const wire::Request& request) {
  const auto id = guest.post(request, served_);
  NODAL_ASSERT(id);
  settle();
  for (Duration waited; waited <= kReplyWithin; waited = waited + kTick) {
    if (auto reply = guest.take_reply(*id)) return *reply;
    NODAL_ASSERT(!guest.dead());
    run(kTick);
  }
  NODAL_ASSERT(false && "a good host has its reply within a second");
}

void Stand::restart(std::unique_ptr<hal::sim::SimDisk> disk) {
  guests_.clear();
  vandals_.clear();
  rig_.reset();
  disk_ = std::move(disk);
  start();
  settle();
}

void Stand::check_conserved() {
  const firmware::CaptureReport& report = rig_->capture().report();
  for (std::size_t i = 0; i < world_.heads(); ++i) {
    const firmware::FrameCounts& counts = report.heads[i].counts;
    NODAL_ASSERT(counts.conserved());
    NODAL_ASSERT(counts.frames == world_.head(i).counts().taken - taken_before_[i]);
  }
}

void Stand::take_news() {
  for (const std::string& sentence : rig_->control().take_news()) {
    NODAL_ASSERT(sentence.size() <= kSentenceBytes);
    NODAL_ASSERT(
        std::none_of(sentence.begin(), sentence.end(), [](char c) { return (c >= 0 && c < ' ') || c == 0x7F; }));
    log_bytes_ += static_cast<std::int64_t>(sentence.size()) + kLineBytes;
  }
  NODAL_ASSERT(log_bytes_ <= kLogBytesAtOnce + kLogBytesASecond * ((world_.now() - started_).ms() / 1000));
}

void Stand::check_settings_file() {
  const auto size = disk_->size(firmware::kSettingsFile);
  if (size) NODAL_ASSERT(*size <= firmware::kMaxSettingsBytes);
}

void Stand::check() {
  for (const auto& guest : guests_) {
    const auto wait = guest->longest_wait(served_);
    NODAL_ASSERT(!wait || *wait <= kReplyWithin);
  }
  std::erase_if(guests_, [](const auto& guest) { return guest->dead(); });
  std::erase_if(vandals_, [](const auto& vandal) { return vandal->dead(); });
  take_news();
  check_conserved();
  check_settings_file();
  const std::int64_t live = live_heap_bytes() - heap_before_;
  NODAL_ASSERT(live <= heap_steady_ * 3 / 2 + kInFlightBytes);
  program_ran_ |= rig_->capture().report().exposure.settings.program != firmware::ExposureProgram::kManual;
}

void Stand::check_left_behind() {
  leave_all();
  check();
  const std::int64_t live = live_heap_bytes() - heap_before_;
  const std::int64_t uploaded = std::min(bytes_sent_, kMaxUploaded);
  NODAL_ASSERT(live <= heap_steady_ * 3 / 2 + kLeftBehindBytes + uploaded);
}

void Stand::check_repeated(const wire::Request& request) {
  const auto live_after_repeats = [&] {
    leave_all();
    Guest& guest = connect();
    for (unsigned i = 0; i < kRepeats && guest.post(request, served_); ++i) settle();
    run(kTick);
    leave_all();
    check();
    return live_heap_bytes();
  };
  const std::int64_t once = live_after_repeats();
  NODAL_ASSERT(live_after_repeats() <= once + kRepeatedBytes);
}

void Stand::check_recovery() {
  events_left_ = std::max(events_left_, kEventsOfACheck);
  check_left_behind();
  Guest& good = connect();
  wire::Request request;
  request.mutable_status();
  if (ask(good, request).status().calibration_id().empty()) return;  // without a calibration there are no raymaps
  request.mutable_genlock()->set_action(wire::GenlockRequest::STOP);
  NODAL_ASSERT(ask(good, request).has_genlock());
  request.mutable_exposure()->set_program("manual");
  NODAL_ASSERT(ask(good, request).has_exposure());
  request.mutable_head_set()->set_exposure_ns(static_cast<std::uint64_t>(nature().rate.period().ns()) / 4);
  NODAL_ASSERT(ask(good, request).has_done());
  run(kConverge);
  const auto& made = rig_->blender().counts().blended;
  const std::uint64_t before = made.load();
  run(kWatch);
  const auto wanted = static_cast<std::uint64_t>(kWatch.ns() / nature().rate.period().ns());
  NODAL_ASSERT((made.load() - before) * 10 >= wanted * 9);
  leave_all();
  check();
}

void Stand::check_restart() {
  events_left_ = std::max(events_left_, kEventsOfACheck);
  const auto frames = [&](std::size_t head) { return rig_->capture().report().heads[head].counts.frames; };
  leave_all();
  const std::array earlier{frames(0), frames(1)};
  run(kConverge);
  check();
  const firmware::CaptureReport before = rig_->capture().report();
  restart(disk_->after_kill());
  run(kConverge);
  check();
  if (disk_failed_) return;
  const firmware::CaptureReport& after = rig_->capture().report();
  const bool was_on = before.genlock.state != firmware::GenlockState::kOff;
  NODAL_ASSERT(was_on == (after.genlock.state != firmware::GenlockState::kOff));
  if (was_on) NODAL_ASSERT(before.genlock.rate.period() == after.genlock.rate.period());
  NODAL_ASSERT(before.exposure.settings == after.exposure.settings);
  constexpr std::uint64_t kFramesToFollow = 6;
  for (std::size_t i = 0; i < world_.heads() && !program_ran_; ++i) {
    if (before.heads[i].counts.frames - earlier[i] < kFramesToFollow || frames(i) < kFramesToFollow) continue;
    NODAL_ASSERT(before.heads[i].in_effect == after.heads[i].in_effect);
  }
}

}  // namespace nodal::fuzz
