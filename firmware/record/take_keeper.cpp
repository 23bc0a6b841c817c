#include "firmware/record/take_keeper.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/record/take_writer.h"
#include "firmware/storage/durable_file.h"
#include "protocol/take/documents.h"

namespace nodal::firmware {

static_assert(TakeRequest::Mark::kMaxBytes == take::kMaxMarkBytes);

std::string_view take_state_name(TakeState state) {
  switch (state) {
    case TakeState::kRecording: return "recording";
    case TakeState::kComplete: return "complete";
    case TakeState::kUnfinished: return "unfinished";
    case TakeState::kDamaged: return "damaged";
    case TakeState::kSetAside: return "set aside";
  }
  return "";
}

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
      answers_(64 + 4),
      recovery_(disk, confined),
      rate_(config.rate) {
  report_.loop = config_.takes->loop;
  if (places_seams_) places_seams_->log_seams();
}

TakeKeeper::~TakeKeeper() = default;

bool TakeKeeper::step(Instant now) {
  bool busy = false;
  if (!loaded_) {
    loaded_ = true;
    load();
    busy = true;
  }
  busy |= store_calibration();
  busy |= take_seams();
  busy |= write_rows(now);
  busy |= write_flight(now, kFlightRecordsAStep);
  sync_if_due(now);
  end_late_still(now);
  busy |= take_request(now);  // also while rows always wait, because the disk is too slow
  if (!busy) busy = step_test(now);
  busy |= recover_some(!busy && (recovery_.is_beside() || !writing_));
  if (busy || now >= next_report_) publish(now);
  return busy;
}

bool TakeKeeper::take_request(Instant now) {
  const auto request = requests_.pop();
  if (!request) return false;
  auto done = run(*request, now);
  if (!done) answer(request->ticket, fail(done.error()));
  else if (*done) answer(request->ticket, std::move(**done));
  return true;
}

/// Nothing: the answer comes later.
Result<std::optional<TakeKeeper::Answered>> TakeKeeper::run(const TakeRequest& request, Instant now) {
  const auto done = [](std::uint64_t take) { return std::optional<Answered>(TakeAnswer::Done{take}); };
  if (!loaded_status_) return fail(loaded_status_.error());
  if (const auto* what = std::get_if<TakeRequest::Start>(&request.what)) {
    const auto take = start(*what, now);
    report_.refused = take ? "" : "no take began: " + take.error().message;
    if (!take) return fail(take.error());
    if (!what->still) return done(*take);
    stopping_.push_back(request.ticket);
    return std::optional<Answered>();
  }
  if (std::holds_alternative<TakeRequest::List>(request.what)) {
    TakeAnswer::Listed listed;
    for (const auto& [number, entry] : takes_) listed.takes.push_back(entry);
    return std::optional<Answered>(std::move(listed));
  }
  if (const auto* what = std::get_if<TakeRequest::Delete>(&request.what)) {
    if (const Status removed = remove(*what); !removed) return fail(removed.error());
    return done(what->take);
  }
  if (const auto* what = std::get_if<TakeRequest::Protect>(&request.what)) {
    const auto entry = finished(what->take);
    if (!entry) return fail(entry.error());
    const std::string folder = take::take_folder(what->take), file = folder + "/" + take::kProtectedFile;
    Status set = what->on ? write_durably(disk_, folder, file, "") : disk_.remove(file);
    if (!set && set.error().code == Errc::kNotFound) set = {};
    if (set && !what->on) set = disk_.sync_folder(folder);
    if (!set) return fail(set.error());
    (*entry)->is_protected = what->on;
    return done(what->take);
  }
  if (const auto* what = std::get_if<TakeRequest::TestDisk>(&request.what)) {
    if (const Status begun = begin_test(request.ticket, *what, now); !begun) return fail(begun.error());
    return std::optional<Answered>();
  }
  if (!writing_ || ending_) return fail(Errc::kWrongState, "no take is being recorded; start one: nodal take start");
  if (const auto* what = std::get_if<TakeRequest::Mark>(&request.what)) {
    if (const Status marked = writing_->mark(what->text, now); !marked) return fail(marked.error());
    return done(writing_->number());
  }
  stopping_.push_back(request.ticket);
  tell_to_end("stopped");
  return std::optional<Answered>();
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
  if (writing_ && still_ && now - report_.since >= kStillWithin) tell_to_end("still");
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

Status TakeKeeper::check_room() {
  const std::uint64_t needed = room_to_start();
  if (const Status made = make_room(needed); !made) return made;
  if (report_.free_bytes >= needed) return {};
  return fail(Errc::kDiskFull,
              fmt::format("the disk of the takes has {} MB free, and a take needs at least {} MB to start; "
                          "delete takes (nodal take delete) or change the card",
                          report_.free_bytes / 1'000'000, needed / 1'000'000));
}

Result<std::uint64_t> TakeKeeper::start(const TakeRequest::Start& start, Instant now) {
  if (writing_) {
    return fail(Errc::kWrongState,
                fmt::format("take {} is being recorded; stop it first: nodal take stop", writing_->number()));
  }
  while (config_.takes->loop && takes_.size() >= kMostTakes) {
    const auto deleted = delete_oldest();
    if (!deleted) return fail(deleted.error());
    if (!*deleted) break;
  }
  if (takes_.size() >= kMostTakes) {
    return fail(Errc::kTooLarge,
                fmt::format("the disk has {} takes, the most that there may be; delete some", takes_.size()));
  }
  if (const Status good = check_pictures(start.heads); !good) return fail(good.error());
  rate_ = start.rate.value_or(config_.rate);
  expected_set_bytes_ = set_bytes(start.heads);
  if (expected_set_bytes_ > recorder_.ring().size() / 4) {
    return fail(Errc::kBadValue, fmt::format("a set of pictures has {} MB; [takes] buffer_mb must be at least {}",
                                             expected_set_bytes_ >> 20, (expected_set_bytes_ >> 18) + 1));
  }
  if (test_) end_test(fail(Errc::kBusy, "a take began, which has priority; test the disk when none is recorded"));
  if (const Status room = check_room(); !room) return fail(room.error());
  const std::uint64_t number = next_take_;
  if (const Status stored = write_durably(disk_, "", kNextTakeFile, std::to_string(number + 1)); !stored) {
    return fail(stored.error());
  }
  next_take_ = number + 1;
  TakeWriter::Documents documents;
  documents.about = document_of(start, number, now);
  documents.calibration = start.calibration;
  documents.calibration_json = start.calibration_json;
  if (config_.text) documents.rig_toml = *config_.text;
  if (!documents.about.layout.empty()) {
    documents.raymap_width = config_.raymap.width;
    documents.raymap_height = config_.raymap.height;
  }
  const bool raymaps = !documents.about.layout.empty();
  TakeEntry entry;
  entry.number = number;
  entry.state = TakeState::kRecording;
  entry.started_utc_ns = documents.about.started_utc_ns;
  entry.raymap_width = documents.raymap_width;
  entry.raymap_height = documents.raymap_height;
  auto writer = TakeWriter::begin(disk_, std::move(documents));
  if (!writer) return fail(writer.error());
  takes_[number] = entry;
  writing_ = std::move(*writer);
  if (seams_) writing_->use_seams(*seams_);
  report_.recording = number;
  report_.since = now;
  report_.durable.reset();
  report_.problem.clear();
  ending_ = broken_ = false;
  cause_.clear();
  lost_by_sync_.clear();
  dropped_sets_ = 0;
  lost_before_ = recorder_.counts().lost_sets.load();
  raymaps_lost_before_ = recorder_.counts().lost_raymaps.load();
  next_sync_ = now + kSyncEvery;
  begin_flight();
  still_ = start.still;
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
  while (!writing_ || writing_->takes_seams()) {
    auto change = places_seams_->seam_changes_out().pop();
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
    if (broken_) {
      dropped_sets_ += row->sets.size();
    } else if (const Status written = writing_->write(*row); !written) {
      give_up(written.error());
    }
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
  dropped_sets_ += cut;
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
  const auto ahead = static_cast<std::uint64_t>(kLoopAhead.ns() / 1'000'000'000);
  const Status room = make_room(2 * kReserveBytes + recorder_.ring().size() + ahead * bytes_a_second());
  if (!room) return give_up(room.error());
  // What the ring holds may still come.
  if (report_.free_bytes < kReserveBytes + recorder_.ring().used() + bytes_a_second()) {
    give_up({Errc::kDiskFull, config_.takes->loop
                                  ? "the disk is full, and what is left on it is protected, near a mark, a still or no "
                                    "take; delete takes (nodal take delete) or change the card"
                                  : "the disk is full; delete takes (nodal take delete) or change the card"});
    broken_ = false;  // there is room for the rows that are on the way
  }
}

void TakeKeeper::end(Instant now) {
  const std::uint64_t number = writing_->number();
  const LostSets lost{recorder_.counts().lost_sets.load() - lost_before_, dropped_sets_};
  end_flight(now);
  const auto manifest = writing_->end(reason_, lost);
  writing_.reset();
  ending_ = broken_ = false;
  report_.recording.reset();
  TakeEntry& entry = takes_.at(number);
  if (manifest) {
    entry.complete(*manifest);
  } else {
    entry.state = TakeState::kUnfinished;
    entry.problem = manifest.error().message;
    if (cause_.empty()) cause_ = manifest.error().message;
  }
  if (!cause_.empty()) {
    report_.problem = fmt::format("take {} ended{}: {}", number,
                                  manifest ? "" : ", and is finished when nodald starts again", cause_);
  }
  const bool empty_still = still_ && manifest && manifest->sets == 0;
  if (empty_still) (void)remove({number});
  for (const std::uint64_t ticket : std::exchange(stopping_, {})) {
    if (empty_still) answer(ticket, fail(Errc::kNotReady, "no set came; `nodal status` says why"));
    else if (manifest) answer(ticket, TakeAnswer::Done{number});
    else answer(ticket, fail(manifest.error()));
  }
  publish(now);
}

void TakeKeeper::answer(std::uint64_t ticket, Result<Answered> result) {
  const bool pushed = answers_.push({ticket, std::move(result)});
  NODAL_ASSERT(pushed);  // it has room for all requests
}

void TakeKeeper::publish(Instant now) {
  next_report_ = now + kReportEvery;
  const Recorder::Counts& counts = recorder_.counts();
  report_.ready = loaded_ && loaded_status_ && half_deleted_.empty() && (recovery_.is_beside() || recovery_.idle());
  report_.test_percent.reset();
  if (test_) report_.test_percent = test_->test->percent(now);
  report_.sets = writing_ ? writing_->sets() : 0;
  report_.lost_sets = writing_ ? counts.lost_sets.load() - lost_before_ + dropped_sets_ : 0;
  report_.lost_by_errors = writing_ ? dropped_sets_ : 0;
  report_.lost_raymaps = writing_ ? counts.lost_raymaps.load() - raymaps_lost_before_ : 0;
  const bool encodes = writing_ && std::ranges::count(config_.heads, TakeMode::kJpeg, &HeadConfig::take_mode) > 0;
  report_.quality = encodes ? recorder_.quality_now() : 0;
  report_.leaves_out_raymaps = writing_ && config_.takes->raymap && recorder_.leaves_out_raymaps();
  report_.buffer_percent = static_cast<std::uint32_t>(recorder_.ring().used() * 100 / recorder_.ring().size());
  report_.bytes_a_second = bytes_a_second();
  snapshot_.publish(report_);
}

void TakeKeeper::close(Instant now) {
  recovery_.close();
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
