#include "firmware/record/take_keeper.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/flight/flight_recorder.h"
#include "firmware/record/recording.h"
#include "firmware/record/take_description.h"
#include "protocol/base/try.h"
#include "protocol/take/limits.h"

namespace nodal::firmware {

namespace {

static_assert(TakeRequest::Mark::kMaxBytes == take::kMaxMarkBytes);

/// A name that is taken is passed over: somebody may have made it after the disk was read.
Result<std::unique_ptr<TakeWriter>> new_take(TakeShelf& shelf, hal::DiskPort& disk, TakeWriter::Documents& documents) {
  constexpr int kTries = 100;
  for (int tries = 1;; ++tries) {
    NODAL_TRY_ASSIGN(const auto number, shelf.new_number());
    documents.about.number = number;
    auto writer = TakeWriter::begin(disk, documents);
    if (writer || writer.error().code != Errc::kExists || tries == kTries) return writer;
  }
}

}  // namespace

TakeKeeper::TakeKeeper(const RigConfig& config, hal::DiskPort& disk, Recorder& recorder, std::string software,
                       UtcClock utc, FlightLog* flight, SeamLog* seams, hal::ConfinedPort* confined)
    : config_(config),
      disk_(disk),
      recorder_(recorder),
      software_(std::move(software)),
      utc_(std::move(utc)),
      flight_(flight),
      calibrations_(2),
      shelf_(disk, config.takes->loop, confined),
      seams_(seams),
      test_(config_, disk, shelf_, mail_, recorder.ring().size()),
      rate_{config.rate} {
  report_.loop = config_.takes->loop;
}

TakeKeeper::~TakeKeeper() = default;

bool TakeKeeper::step(Instant now) {
  bool busy = watch_disk(now);
  busy |= step_recording(now);
  busy |= take_request(now);  // also while rows always wait, because the disk is too slow
  busy |= step_eject();
  busy |= test_.step(now);  // also while hosts ask without a pause
  busy |= shelf_.recover_some(now, !busy && (shelf_.recovers_beside() || !recording_));
  if (std::string problem = shelf_.take_problem(); !problem.empty()) report_.problem = std::move(problem);
  if (busy || now >= next_report_) publish(now);
  return busy;
}

bool TakeKeeper::watch_disk(Instant now) {
  if (recording_ || test_.running() || now < next_look_) return false;
  next_look_ = now + kLookEvery;
  const bool changed = shelf_.watch();
  if (shelf_.here()) {
    const auto free = disk_.free_bytes();
    report_.free_bytes = free.value_or(0);
    report_.total_bytes = disk_.total_bytes().value_or(0);
    if (report_.interrupted || !report_.refused.empty())
      report_.has_room = config_.takes->loop || (free && *free >= room_to_start());
  }
  return changed;
}

bool TakeKeeper::step_recording(Instant now) {
  const auto calibration = calibrations_.pop();
  bool busy = calibration.has_value();
  if (flight_) flight_->collect(now);
  if (!recording_) return seams_.step(nullptr) || busy;
  if (calibration) recording_->use_calibration(*calibration, report_);
  busy |= recording_->step(now, utc_(), report_);
  if (recording_->phase() == Recording::Phase::kOver) end(now);
  return busy;
}

std::uint64_t TakeKeeper::room_to_start() const {
  const Duration least = config_.takes->loop ? kMinLoopRoom : kMinRoom;
  const auto seconds = static_cast<std::uint64_t>(least.ns() / 1'000'000'000);
  return rate_.bytes_a_second(recorder_) * seconds + 2 * Recording::kReserveBytes;
}

/// Room for the start of a take, and a place in the list.
Status TakeKeeper::check_room() {
  std::uint64_t going = 0;
  if (shelf_.is_full()) {
    NODAL_TRY_ASSIGN(const auto oldest, shelf_.oldest_to_go());
    going = oldest;
  }
  const std::uint64_t needed = room_to_start();
  NODAL_TRY_ASSIGN(const auto free, shelf_.make_room(needed, needed, nullptr));
  report_.free_bytes = free;
  if (free < needed) {
    return fail(Errc::kDiskFull,
                fmt::format("the disk of the takes has {} MB free, and a take needs at least {} MB to start; "
                            "delete takes (nodal take delete) or change the card",
                            free / 1'000'000, needed / 1'000'000));
  }
  return shelf_.is_full() ? shelf_.remove(going) : Status();
}

Result<std::uint64_t> TakeKeeper::start(const TakeRequest::Start& start, Instant now) {
  if (recording_) {
    return fail(Errc::kWrongState,
                fmt::format("take {} is being recorded; stop it first: nodal take stop", recording_->number()));
  }
  NODAL_TRY(check_pictures(config_, start.heads));
  rate_.rate = start.rate.value_or(config_.rate);
  rate_.expected_set_bytes = set_bytes(config_, start.heads);
  if (rate_.expected_set_bytes > recorder_.ring().size() / 4) {
    return fail(Errc::kBadValue, fmt::format("a set of pictures has {} MB; [takes] buffer_mb must be at least {}",
                                             rate_.expected_set_bytes >> 20, (rate_.expected_set_bytes >> 18) + 1));
  }
  test_.end(fail(Errc::kBusy, "a take began, which has priority; test the disk when none is recorded"));
  shelf_.use_again();
  NODAL_TRY_ASSIGN(auto held, shelf_.hold());
  NODAL_TRY(check_room());
  TakeWriter::Documents documents = documents_of(config_, start);
  documents.about.software = software_;
  documents.about.started_utc_ns = std::clamp<std::int64_t>(utc_(), 0, take::kMaxUtcNs);
  documents.about.started_ns = now.ns();
  documents.about.rate = rate_.rate;
  NODAL_TRY_ASSIGN(auto writer, new_take(shelf_, disk_, documents));
  TakeEntry entry;
  entry.number = documents.about.number;
  entry.started_utc_ns = documents.about.started_utc_ns;
  entry.raymap_width = documents.raymap_width;
  entry.raymap_height = documents.raymap_height;
  shelf_.begin(entry);
  report_.recording = entry.number;
  report_.since = now;
  report_.durable.reset();
  report_.problem.clear();
  report_.interrupted = false;
  recording_ = std::make_unique<Recording>(Recording::Parts{recorder_, shelf_, seams_, flight_, config_.takes->loop},
                                           Recording::Order{!documents.about.layout.empty(), start.still, rate_},
                                           std::move(writer), std::move(held), now, report_);
  return entry.number;
}

/// The take is over: its files are finished, and those who waited for it are answered.
void TakeKeeper::end(Instant now) {
  Recording::Ended ended = recording_->finish();
  const auto& manifest = ended.manifest;
  report_.recording.reset();
  shelf_.finish(ended.take, manifest);
  report_.interrupted = !ended.cause.empty() || ejecting_;
  report_.has_room = !report_.interrupted;  // until the next look
  if (!ended.cause.empty()) {
    const bool waits = !manifest && shelf_.takes().contains(ended.take);
    report_.problem = fmt::format("take {} ended{}: {}", ended.take,
                                  waits ? ", and is finished when nodald starts again" : "", ended.cause);
  }
  if (ended.empty_still) (void)shelf_.remove(ended.take);
  recording_.reset();  // lets go of the disk
  next_look_ = now;
  for (const std::uint64_t ticket : std::exchange(stopping_, {})) {
    if (ended.empty_still) mail_.answer(ticket, fail(Errc::kNotReady, "no set came; `nodal status` says why"));
    else if (manifest) mail_.answer(ticket, TakeAnswer::Done{ended.take});
    else mail_.answer(ticket, fail(manifest.error()));
  }
  if (ejecting_ && manifest) ejecting_->take = ended.take;
  if (ejecting_ && !manifest) {
    mail_.answer(ejecting_->tickets, fail(manifest.error()));
    ejecting_.reset();
  }
  publish(now);
}

void TakeKeeper::publish(Instant now) {
  next_report_ = now + kReportEvery;
  report_.ready = shelf_.ready();
  report_.no_disk = shelf_.problem();
  report_.ejected = shelf_.ejected();
  report_.disks = shelf_.disks();
  report_.deleted_segments = shelf_.deleted_segments();
  report_.test_percent = test_.percent(now);
  report_.sets = report_.lost_by_errors = report_.lost_sets = report_.lost_raymaps = 0;
  if (recording_) recording_->fill(report_);
  const bool encodes = recording_ && std::ranges::count(config_.heads, TakeMode::kJpeg, &HeadConfig::take_mode) > 0;
  report_.quality = encodes ? recorder_.quality_now() : 0;
  report_.leaves_out_raymaps = recording_ && config_.takes->raymap && recorder_.leaves_out_raymaps();
  report_.buffer_percent = static_cast<std::uint32_t>(recorder_.ring().used() * 100 / recorder_.ring().size());
  report_.bytes_a_second = rate_.bytes_a_second(recorder_);
  snapshot_.publish(report_);
}

void TakeKeeper::close(Instant now) {
  shelf_.close();
  if (recording_) recording_->close();
  while (recording_) {
    recorder_.step();
    step_recording(now);
  }
}

}  // namespace nodal::firmware
