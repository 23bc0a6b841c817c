#include "firmware/record/take_keeper.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/record/take_writer.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"
#include "protocol/take/limits.h"

namespace nodal::firmware {

namespace {

static_assert(TakeRequest::Mark::kMaxBytes == take::kMaxMarkBytes);

/// Without the number, and without what the rig knows besides its configuration.
TakeWriter::Documents documents_of(const RigConfig& config, const TakeRequest::Start& start) {
  TakeWriter::Documents documents;
  documents.about.rig = printable(config.name, take::kMaxTakeTextBytes);
  documents.about.mode = mode_names(config.heads);
  if (start.calibration) documents.about.calibration_id = to_hex(*start.calibration);
  documents.calibration = start.calibration;
  for (const HeadConfig& head : config.heads)
    documents.about.heads.push_back(printable(head.name, take::kMaxTakeTextBytes));
  documents.calibration_json = start.calibration_json;
  if (config.text) documents.rig_toml = *config.text;
  if (config.takes->raymap && start.calibration) {
    documents.about.layout = config.raymap.layout;
    documents.raymap_width = config.raymap.width;
    documents.raymap_height = config.raymap.height;
  }
  return documents;
}

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
                       UtcClock utc, FlightLog* flight, Blender* places_seams, hal::ConfinedPort* confined)
    : config_(config),
      disk_(disk),
      recorder_(recorder),
      software_(std::move(software)),
      utc_(std::move(utc)),
      flight_(flight),
      places_seams_(places_seams),
      requests_(64),
      calibrations_(2),
      answers_(64 + 3 * kMaxWaitingTickets),
      shelf_(disk, config.takes->loop, confined),
      rate_(config.rate) {
  report_.loop = config_.takes->loop;
  if (places_seams_) places_seams_->seams().log_changes();
}

TakeKeeper::~TakeKeeper() = default;

bool TakeKeeper::step(Instant now) {
  bool busy = watch_disk(now);
  busy |= store_calibration();
  busy |= take_seams();
  busy |= write_rows(now);
  busy |= write_flight(now, kFlightRecordsAStep);
  sync_if_due(now);
  end_late_still(now);
  busy |= take_request(now);  // also while rows always wait, because the disk is too slow
  busy |= step_eject();
  busy |= step_test(now);  // also while hosts ask without a pause
  busy |= shelf_.recover_some(now, !busy && (shelf_.recovers_beside() || !writing_));
  if (std::string problem = shelf_.take_problem(); !problem.empty()) report_.problem = std::move(problem);
  if (busy || now >= next_report_) publish(now);
  return busy;
}

bool TakeKeeper::watch_disk(Instant now) {
  if (writing_ || test_ || now < next_look_) return false;
  next_look_ = now + kLookEvery;
  const bool changed = shelf_.watch();
  if ((report_.interrupted || !report_.refused.empty()) && shelf_.here()) {
    const auto free = disk_.free_bytes();
    report_.has_room = config_.takes->loop || (free && *free >= room_to_start());
  }
  return changed;
}

/// The ring has room: a take begins after the one before it has ended, so the recorder has taken that one's begin.
void TakeKeeper::tell_to_end(const std::string& reason) {
  if (ending_) return;
  ending_ = true;
  reason_ = reason;
  const bool told = recorder_.orders().push({RecordOrder::Kind::kEnd, writing_->number(), false, false});
  NODAL_ASSERT(told);
}

void TakeKeeper::end_late_still(Instant now) {
  if (writing_ && still_ && now - report_.since >= kStillWithin.at(period_)) tell_to_end("still");
}

/// Bytes that the heads deliver in a second, by their formats and by the newest recorded set.
std::uint64_t TakeKeeper::bytes_a_second() const {
  const std::uint64_t a_set =
      std::max(recorder_.counts().set_bytes.load(std::memory_order_relaxed), expected_set_bytes_);
  return a_set * rate_.numerator / rate_.denominator;
}

std::uint64_t TakeKeeper::room_to_start() const {
  const Duration least = config_.takes->loop ? kLeastLoopRoom : kLeastRoom;
  return bytes_a_second() * static_cast<std::uint64_t>(least.ns() / 1'000'000'000) + 2 * kReserveBytes;
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
  if (writing_) {
    return fail(Errc::kWrongState,
                fmt::format("take {} is being recorded; stop it first: nodal take stop", writing_->number()));
  }
  NODAL_TRY(check_pictures(start.heads));
  rate_ = start.rate.value_or(config_.rate);
  expected_set_bytes_ = set_bytes(start.heads);
  if (expected_set_bytes_ > recorder_.ring().size() / 4) {
    return fail(Errc::kBadValue, fmt::format("a set of pictures has {} MB; [takes] buffer_mb must be at least {}",
                                             expected_set_bytes_ >> 20, (expected_set_bytes_ >> 18) + 1));
  }
  if (test_) end_test(fail(Errc::kBusy, "a take began, which has priority; test the disk when none is recorded"));
  shelf_.use_again();
  NODAL_TRY_ASSIGN(auto held, shelf_.hold());
  NODAL_TRY(check_room());
  TakeWriter::Documents documents = documents_of(config_, start);
  describe(documents.about, now);
  const bool raymaps = !documents.about.layout.empty();
  NODAL_TRY_ASSIGN(auto writer, new_take(shelf_, disk_, documents));
  const std::uint64_t number = documents.about.number;
  TakeEntry entry;
  entry.number = number;
  entry.started_utc_ns = documents.about.started_utc_ns;
  entry.raymap_width = documents.raymap_width;
  entry.raymap_height = documents.raymap_height;
  shelf_.begin(entry);
  held_.emplace(std::move(held));
  writing_ = std::move(writer);
  if (seams_) writing_->use_seams(*seams_);
  report_.recording = number;
  report_.since = now;
  report_.durable.reset();
  report_.problem.clear();
  report_.interrupted = false;
  ending_ = broken_ = false;
  cause_.clear();
  lost_by_sync_.clear();
  given_sets_ = 0;
  lost_before_ = recorder_.counts().lost_sets.load();
  raymaps_lost_before_ = recorder_.counts().lost_raymaps.load();
  next_sync_ = now + kSyncEvery;
  begin_flight();
  still_ = start.still;
  period_ = start.rate.value_or(rate_).period();
  reason_ = start.still ? "still" : "";
  const bool told = recorder_.orders().push({RecordOrder::Kind::kBegin, number, raymaps, start.still});
  NODAL_ASSERT(told);
  return number;
}

bool TakeKeeper::store_calibration() {
  const auto calibration = calibrations_.pop();
  if (!calibration || !writing_ || broken_) return calibration.has_value();
  if (const Status stored = writing_->use_calibration(*calibration); !stored) give_up(stored.error());
  if (writing_->left_out_calibrations()) {
    report_.problem = fmt::format(
        "take {} has {} calibrations, the most that it can have: sets with later ones cannot be rendered; start "
        "another "
        "take: nodal take start",
        writing_->number(), take::kMostCalibrations);
  }
  return true;
}

bool TakeKeeper::take_seams() {
  if (!places_seams_) return false;
  bool busy = false;
  auto& changes = places_seams_->seams().changes();
  for (std::size_t taken = 0; taken < changes.capacity() && (!writing_ || writing_->takes_seams()); ++taken) {
    auto change = changes.pop();
    if (!change) break;
    seams_ = std::move(*change);
    if (writing_ && !broken_) writing_->use_seams(*seams_);
    busy = true;
  }
  return busy;
}

/// Whether to hold a row back because the blend may still log seams for its sets.
bool TakeKeeper::blend_is_behind(const TakeRow& row, Instant now) {
  if (!places_seams_ || row.sets.empty() || closing_) return false;
  const std::uint64_t begun = places_seams_->sets_begun();
  if (std::exchange(begun_, begun) != begun) begun_at_ = now;
  const bool room = 100 * recorder_.ring().used() <= kSetsAhead * recorder_.ring().size();
  return begun <= row.sets.back().number && room && now - begun_at_ < kBlendWithin;
}

bool TakeKeeper::write_rows(Instant now) {
  bool busy = false;
  for (int k = 0; k < kRowsAStep; ++k) {
    if (!row_) row_ = recorder_.rows().pop().value_or(nullptr);
    if (!row_ || blend_is_behind(*row_, now)) break;
    take_seams();
    busy = true;
    std::unique_ptr<TakeRow> row = std::move(row_);
    given_sets_ += row->sets.size();
    if (const Status written = broken_ ? Status() : writing_->write(*row); !written) give_up(written.error());
    const bool last = row->last;
    recorder_.ring().release(row->ring_end);
    const bool returned = recorder_.rows_back().push(std::move(row));
    NODAL_ASSERT(returned);
    if (last) end(now);
  }
  return busy;
}

/// The disk does not take any more: the recorder is told to end, and what comes until then is dropped.
void TakeKeeper::give_up(const Error& error) {
  broken_ = true;
  if (cause_.empty()) cause_ = error.message;
  tell_to_end(error.code == Errc::kDiskFull   ? "disk full"
              : error.code == Errc::kTooLarge ? "as long as a take can be"
                                              : "disk failed");
}

void TakeKeeper::sync_if_due(Instant now) {
  if (!writing_ || broken_ || now < next_sync_) return;
  next_sync_ = now + kSyncEvery;
  if (writing_->synced()) return;
  const std::uint64_t sets = writing_->sets();
  const Status synced = writing_->sync(now, utc_());
  const std::uint64_t cut = sets - std::min(sets, writing_->sets());
  if (synced) {
    report_.durable = now;
    if (!lost_by_sync_.empty()) report_.problem = std::exchange(lost_by_sync_, {});
  } else if (synced.error().code == Errc::kDeviceGone || synced.error().code == Errc::kDiskFull) {
    return give_up(synced.error());
  } else {
    // Said when the next segment is on the disk: if the disk takes nothing more, only that is said.
    lost_by_sync_ = fmt::format("take {}: {} sets were lost by an error of the disk, and a new segment begins: {}",
                                writing_->number(), cut, synced.error().message);
  }
  if (const Status there = shelf_.check_recording(writing_->number()); !there) return give_up(there.error());
  if (const Status room = make_room_while_recording(); !room) return give_up(room.error());
  // What the ring holds may still come.
  if (report_.free_bytes < kReserveBytes + recorder_.ring().used() + bytes_a_second()) {
    give_up(
        {Errc::kDiskFull, config_.takes->loop
                              ? "the disk is full, and what is left on it is protected, near a mark, being copied, a "
                                "still or no take; delete takes (nodal take delete) or change the card"
                              : "the disk is full; delete takes (nodal take delete) or change the card"});
    broken_ = false;  // there is room for the rows that are on the way
  }
}

/// Nothing is deleted if the take must end all the same.
Status TakeKeeper::make_room_while_recording() {
  const auto ahead = static_cast<std::uint64_t>(kLoopAhead.ns() / 1'000'000'000) * bytes_a_second();
  const std::uint64_t least = kReserveBytes + recorder_.ring().used() + ahead;
  NODAL_TRY_ASSIGN(const auto free,
                   shelf_.make_room(2 * kReserveBytes + recorder_.ring().size() + ahead, least, writing_.get()));
  report_.free_bytes = free;
  return {};
}

void TakeKeeper::end(Instant now) {
  const std::uint64_t number = writing_->number();
  const SetCounts counts{recorder_.counts().lost_sets.load() - lost_before_, given_sets_};
  end_flight(now);
  const auto manifest = writing_->end(reason_, counts);
  writing_.reset();
  ending_ = broken_ = false;
  report_.recording.reset();
  shelf_.finish(number, manifest);
  if (!manifest && cause_.empty()) cause_ = manifest.error().message;
  report_.interrupted = !cause_.empty() || ejecting_;
  report_.has_room = !report_.interrupted;  // until the next look
  if (!cause_.empty()) {
    const bool waits = !manifest && shelf_.takes().contains(number);
    report_.problem =
        fmt::format("take {} ended{}: {}", number, waits ? ", and is finished when nodald starts again" : "", cause_);
  }
  const bool empty_still = still_ && manifest && manifest->sets == 0;
  if (empty_still) (void)shelf_.remove(number);
  held_.reset();
  next_look_ = now;
  answer_end(number, manifest, empty_still);
  publish(now);
}

void TakeKeeper::answer(std::uint64_t ticket, Result<Answered> result) {
  const bool pushed = answers_.push({ticket, std::move(result)});
  NODAL_ASSERT(pushed);  // it has room for all requests, and for all that wait
}

void TakeKeeper::publish(Instant now) {
  next_report_ = now + kReportEvery;
  const Recorder::Counts& counts = recorder_.counts();
  report_.ready = shelf_.ready();
  report_.no_disk = shelf_.problem();
  report_.ejected = shelf_.ejected();
  report_.disks = shelf_.disks();
  report_.deleted_segments = shelf_.deleted_segments();
  report_.test_percent.reset();
  if (test_) report_.test_percent = test_->test->percent(now);
  report_.sets = writing_ ? writing_->sets() : 0;
  report_.lost_by_errors = writing_ ? given_sets_ - std::min(given_sets_, report_.sets) : 0;
  report_.lost_sets = writing_ ? counts.lost_sets.load() - lost_before_ + report_.lost_by_errors : 0;
  report_.lost_raymaps = writing_ ? counts.lost_raymaps.load() - raymaps_lost_before_ : 0;
  const bool encodes = writing_ && std::ranges::count(config_.heads, TakeMode::kJpeg, &HeadConfig::take_mode) > 0;
  report_.quality = encodes ? recorder_.quality_now() : 0;
  report_.leaves_out_raymaps = writing_ && config_.takes->raymap && recorder_.leaves_out_raymaps();
  report_.buffer_percent = static_cast<std::uint32_t>(recorder_.ring().used() * 100 / recorder_.ring().size());
  report_.bytes_a_second = bytes_a_second();
  snapshot_.publish(report_);
}

void TakeKeeper::close(Instant now) {
  shelf_.close();
  if (!writing_) return;
  tell_to_end("nodald ended");
  reason_ = "nodald ended";
  closing_ = true;
  while (writing_) {
    recorder_.step();
    write_rows(now);
  }
}

}  // namespace nodal::firmware
