#include "firmware/record/recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/flight/flight_recorder.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"

namespace nodal::firmware {

Recording::Recording(const Parts& parts, const Order& order, std::unique_ptr<TakeWriter> writer, TakeShelf::Hold held,
                     Instant now, TakeReport& report)
    : parts_(parts),
      order_(order),
      writer_(std::move(writer)),
      held_(std::move(held)),
      since_(now),
      reason_(order.still ? "still" : ""),
      before_{parts.recorder.counts().lost_sets.load(), parts.recorder.counts().lost_raymaps.load()},
      next_sync_(now + kSyncEvery) {
  parts_.seams.begin(*writer_);
  if (parts_.flight && !parts_.flight->begin()) {
    report.problem = fmt::format(
        "take {} has no flight record, which must begin with nodald's start: {}; start nodald again before a take",
        number(),
        parts_.flight->overrun() ? "events were lost: they came faster than the disk stored them"
                                 : "nodald runs for too long");
  }
  const bool pushed =
      parts_.recorder.orders().push({RecordOrder::Kind::kBegin, number(), order_.raymaps, order_.still});
  NODAL_ASSERT(pushed);
}

bool Recording::step(Instant now, std::int64_t utc_ns, TakeReport& report) {
  bool busy = write_rows(now);
  busy |= write_flight();
  sync_if_due(now, utc_ns, report);
  if (order_.still && now - since_ >= kStillWithin.at(order_.rate.rate.period())) end("still");
  return busy;
}

/// The ring has room: a take begins after the one before it has ended, so the recorder has taken that one's begin.
void Recording::end(const std::string& reason) {
  if (phase_ != Phase::kRunning) return;
  phase_ = Phase::kEnding;
  reason_ = reason;
  const bool pushed = parts_.recorder.orders().push({RecordOrder::Kind::kEnd, number(), false, false});
  NODAL_ASSERT(pushed);
}

void Recording::close() {
  end("nodald ended");
  reason_ = "nodald ended";
  parts_.seams.close();
}

void Recording::use_calibration(const TakeCalibration& calibration, TakeReport& report) {
  if (!writes()) return;
  if (const Status stored = writer_->use_calibration(calibration); !stored) give_up(stored.error());
  if (writer_->left_out_calibrations()) {
    report.problem = fmt::format(
        "take {} has {} calibrations, the most that it can have: sets with later ones cannot be rendered; start "
        "another take: nodal take start",
        number(), take::kMaxCalibrations);
  }
}

bool Recording::write_rows(Instant now) {
  bool busy = parts_.seams.step(writes() ? writer_.get() : nullptr);
  for (int k = 0; k < kRowsAStep && phase_ < Phase::kFlight; ++k) {
    if (!row_) row_ = parts_.recorder.rows().pop().value_or(nullptr);
    const PictureRing& ring = parts_.recorder.ring();
    if (!row_ || (parts_.seams.is_behind(*row_, now) && 100 * ring.used() <= kSetsAhead * ring.size())) break;
    parts_.seams.step(writes() ? writer_.get() : nullptr);
    busy = true;
    std::unique_ptr<TakeRow> row = std::move(row_);
    given_sets_ += row->sets.size();
    if (const Status written = writes() ? writer_->write(*row) : Status(); !written) give_up(written.error());
    const bool last = row->last;
    parts_.recorder.ring().release(row->ring_end);
    const bool returned = parts_.recorder.rows_back().push(std::move(row));
    NODAL_ASSERT(returned);
    if (!last) continue;
    const bool keeps_flight = parts_.flight && writes();
    if (parts_.flight) parts_.flight->collect(now);
    if (parts_.flight) parts_.flight->close_record();
    if (parts_.flight && !keeps_flight) (void)parts_.flight->end();
    phase_ = keeps_flight ? Phase::kFlight : Phase::kOver;
  }
  return busy;
}

/// A limited number of records in each step, because at the end of a take all records since nodald's start may be left.
bool Recording::write_flight() {
  if (!parts_.flight || phase_ == Phase::kOver) return false;
  for (int k = 0; k < kFlightRecordsAStep; ++k) {
    const auto record = parts_.flight->next();
    if (record.empty()) {
      if (phase_ != Phase::kFlight) return k > 0;
      if (const auto last = parts_.flight->end(); !last.empty()) writer_->write_flight(last);
      phase_ = Phase::kOver;
      return true;
    }
    if (phase_ != Phase::kDropping) writer_->write_flight(record);
  }
  return true;
}

/// The disk accepts no more data: the recorder is asked to end, and the rows that it closes until then are dropped.
void Recording::give_up(const Error& error) {
  if (cause_.empty()) cause_ = error.message;
  end(error.code == Errc::kDiskFull   ? "disk full"
      : error.code == Errc::kTooLarge ? "as long as a take can be"
                                      : "disk failed");
  phase_ = Phase::kDropping;
}

void Recording::sync_if_due(Instant now, std::int64_t utc_ns, TakeReport& report) {
  if (!writes() || now < next_sync_) return;
  next_sync_ = now + kSyncEvery;
  if (writer_->synced()) return;
  const std::uint64_t sets = writer_->sets();
  const Status synced = writer_->sync(now, utc_ns);
  const std::uint64_t cut = sets - std::min(sets, writer_->sets());
  if (synced) {
    report.durable = now;
    if (!lost_by_sync_.empty()) report.problem = std::exchange(lost_by_sync_, {});
  } else if (synced.error().code == Errc::kDeviceGone || synced.error().code == Errc::kDiskFull) {
    return give_up(synced.error());
  } else {
    // Said when the next segment is on the disk: if the disk takes nothing more, only that is said.
    lost_by_sync_ = fmt::format("take {}: {} sets were lost by an error of the disk, and a new segment begins: {}",
                                number(), cut, synced.error().message);
  }
  if (const Status checked = parts_.shelf.check_recording(number()); !checked) return give_up(checked.error());
  const auto room = make_room();
  if (!room) return give_up(room.error());
  report.free_bytes = *room;
  // What the ring holds may still come.
  const PictureRing& ring = parts_.recorder.ring();
  if (*room >= kReserveBytes + ring.used() + order_.rate.bytes_a_second(parts_.recorder)) return;
  if (cause_.empty()) {
    cause_ = parts_.loop ? "the disk is full, and what is left on it is protected, near a mark, being copied, a "
                           "still or no take; delete takes (nodal take delete) or change the card"
                         : "the disk is full; delete takes (nodal take delete) or change the card";
  }
  end("disk full");  // there is room for the rows that are on the way
}

/// Returns the free bytes. Nothing is deleted if the take must end all the same.
Result<std::uint64_t> Recording::make_room() {
  const auto a_second = order_.rate.bytes_a_second(parts_.recorder);
  const auto ahead = static_cast<std::uint64_t>(kLoopAhead.ns() / 1'000'000'000) * a_second;
  const PictureRing& ring = parts_.recorder.ring();
  return parts_.shelf.make_room(2 * kReserveBytes + ring.size() + ahead, kReserveBytes + ring.used() + ahead,
                                writer_.get());
}

Recording::Ended Recording::finish() {
  NODAL_ASSERT(phase_ == Phase::kOver);
  const SetCounts counts{parts_.recorder.counts().lost_sets.load() - before_.sets, given_sets_};
  Ended ended{number(), writer_->end(reason_, counts), std::move(cause_), false};
  if (!ended.manifest && ended.cause.empty()) ended.cause = ended.manifest.error().message;
  ended.empty_still = order_.still && ended.manifest && ended.manifest->sets == 0;
  return ended;
}

void Recording::fill(TakeReport& report) const {
  const Recorder::Counts& counts = parts_.recorder.counts();
  report.sets = writer_->sets();
  report.lost_by_errors = given_sets_ - std::min(given_sets_, report.sets);
  report.lost_sets = counts.lost_sets.load() - before_.sets + report.lost_by_errors;
  report.lost_raymaps = counts.lost_raymaps.load() - before_.raymaps;
}

}  // namespace nodal::firmware
