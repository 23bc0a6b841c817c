#include "firmware/record/take_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/record/loop.h"
#include "firmware/storage/durable_file.h"
#include "protocol/base/try.h"
#include "stitch/media/thumbnail.h"

namespace nodal::firmware {
namespace {

std::uint64_t bytes_of(const FinishedSegment& segment) {
  std::uint64_t bytes = 0;
  for (const take::Manifest::File& file : segment.files) bytes += file.bytes;
  return bytes;
}

}  // namespace

Result<std::unique_ptr<TakeWriter>> TakeWriter::begin(hal::DiskPort& disk, Documents documents) {
  std::unique_ptr<TakeWriter> made(new TakeWriter);
  TakePlace& place = made->place_;
  place.disk = &disk;
  place.number = documents.about.number;
  place.folder = take::take_folder(place.number);
  place.rate = documents.about.rate;
  place.raymaps_a_set = documents.about.raymaps_a_set;
  place.utc_offset_ns = documents.about.utc_offset_ns();
  made->heads_ = documents.about.heads.size();
  place.layout = documents.about.layout;
  place.raymap_width = documents.raymap_width;
  place.raymap_height = documents.raymap_height;
  place.software = documents.about.software;
  documents.about.raymap_width = documents.raymap_width;
  documents.about.raymap_height = documents.raymap_height;
  place.calibration_json = std::move(documents.calibration_json);
  if (documents.calibration) place.calibration_id.assign(documents.calibration->begin(), documents.calibration->end());
  const std::string about = take::take_json(documents.about);
  if (const auto parsed = take::parse_take_json(about, place.folder + "/" + take::kTakeFile); !parsed)
    return fail(parsed.error().in("to be written"));
  Status good = disk.make_folder(place.folder);
  if (!good) return fail(good.error());
  good = disk.sync_folder("");
  // take.json last: a folder without it has no set.
  const auto put = [&](const std::string& name, const std::string& text) {
    if (good && !text.empty()) good = create_durably(disk, place.folder, place.folder + "/" + name, text);
  };
  put(take::kCalibrationFile, place.calibration_json);
  put(take::kRigFile, documents.rig_toml);
  put(take::kTakeFile, about);
  if (good) return made;
  for (const std::string& name : {take::kTakeFile, take::kRigFile, take::kCalibrationFile}) {
    (void)disk.remove(place.folder + "/" + name);
  }
  (void)disk.remove(place.folder);
  return fail(good.error());
}

Status TakeWriter::write(const TakeRow& row) {
  if (segment_ && (!segment_->fits(row) || segment_->length() >= kLongestSegment ||
                   segment_->largest_file() >= kLargestFile || segment_->evidence_bytes() >= kLargestEvidence)) {
    NODAL_TRY(finish_segment("segment"));
  }
  NODAL_TRY(cut_segment("sync failed"));
  if (!segment_) {
    if (row.sets.empty()) return {};
    NODAL_TRY(begin_segment(row));
  }
  unsynced_ = true;
  Status written = row.sets.empty() ? Status() : note_seams(row.sets.back().number);
  if (written) written = segment_->write(row);
  failed_ = failed_ || !written;
  if (written && !row.raymaps.empty() && !thumbnail_tried_) write_thumbnail(row);
  return written;
}

Status TakeWriter::begin_segment(const TakeRow& row) {
  const std::size_t streams = static_cast<std::size_t>(
      std::ranges::count_if(row.streams, [](const auto& stream) { return stream.has_value(); }));
  std::size_t listed = kOtherFiles;
  for (const FinishedSegment& segment : finished_) listed += segment.files.size();
  if (listed + streams + 2 > take::kMaxTakeFiles) {  // and raymaps, and evidence
    return fail(Errc::kTooLarge, fmt::format("take {} has {} files, as many as a manifest lists; start another: "
                                             "nodal take start",
                                             place_.number, listed));
  }
  (void)note_seams(row.sets.front().number);  // no segment is open: they are noted at its begin
  NODAL_TRY_ASSIGN(auto segment, SegmentWriter::create(place_, next_segment_, finished_sets_, row));
  segment_ = std::move(segment);
  place_.after_error = false;
  ++next_segment_;
  for (const EarlyMark& mark : std::exchange(early_marks_, {})) {
    const Status marked = segment_->mark(mark.text, mark.at);
    failed_ = failed_ || !marked;
    if (!marked) return marked;
  }
  return {};
}

/// Takes the seams that are in force for this set, and for those before.
Status TakeWriter::note_seams(std::uint64_t set) {
  while (!seams_ahead_.empty() && seams_ahead_.front().first_set <= set) {
    place_.seams = std::move(seams_ahead_.front());
    seams_ahead_.pop_front();
    if (!segment_) continue;
    NODAL_TRY(segment_->note(*place_.seams));
  }
  return {};
}

/// Once, of the first raymap; durable with the next sync. A take without it is as good, so its errors do not count.
void TakeWriter::write_thumbnail(const TakeRow& row) {
  thumbnail_tried_ = true;
  const std::string name = place_.folder + "/" + take::kThumbFile;
  const auto small = media::thumbnail(row.raymaps.front().jpeg, name);
  if (!small || small->size() > kMaxDocumentBytes) return;
  const auto file = place_.disk->create(name);
  if (!file) return;
  const Status written = place_.disk->write(*file, *small);
  place_.disk->close(*file);
  if (!written) (void)place_.disk->remove(name);
}

void TakeWriter::write_flight(std::span<const std::uint8_t> record) {
  if (!flight_) {
    const auto file = place_.disk->create(place_.folder + "/" + take::kFlightFile);
    flight_.emplace();
    if (file) flight_->file = *file;
  }
  if (!flight_->file) return;
  unsynced_ = true;
  flight_->hashes.update(record);
  if (!place_.disk->write(*flight_->file, record)) close_flight();
}

void TakeWriter::close_flight() {
  if (flight_ && flight_->file) place_.disk->close(*std::exchange(flight_->file, std::nullopt));
}

/// After an error of the disk it is cut to the records that are whole.
Result<std::optional<take::Manifest::File>> TakeWriter::finish_flight() {
  if (!flight_) return std::optional<take::Manifest::File>();
  if (!flight_->file) return recover_flight(*place_.disk, place_.folder);
  close_flight();
  return std::optional<take::Manifest::File>(
      {take::kFlightFile, flight_->hashes.bytes(), take::digest_of(flight_->hashes.all())});
}

Status TakeWriter::finish_segment(const std::string& reason) {
  auto files = segment_->finish(reason);
  if (files) {
    // Later segments count as proof that this one is durable.
    if (const Status synced = place_.disk->sync_all(); !synced) files = fail(synced.error());
  }
  if (!files) {
    failed_ = true;
    return fail(files.error());
  }
  FinishedSegment done;
  done.number = next_segment_ - 1;
  done.sets = segment_->sets();
  done.first_set = segment_->next_set() - done.sets;
  done.files = std::move(*files);
  done.length = segment_->length();
  done.marks = segment_->marks();
  done.tally = segment_->tally();
  add(std::move(done));
  segment_.reset();
  unsynced_ = false;
  return {};
}

void TakeWriter::add(FinishedSegment done) {
  finished_sets_ += done.sets;
  finished_.push_back(std::move(done));
}

std::vector<take::Manifest::Mark> TakeWriter::marks() const {
  std::vector<take::Manifest::Mark> all;
  for (const FinishedSegment& segment : finished_) all.insert(all.end(), segment.marks.begin(), segment.marks.end());
  if (segment_) all.insert(all.end(), segment_->marks().begin(), segment_->marks().end());
  for (const EarlyMark& mark : early_marks_) all.push_back({finished_sets_, mark.text});
  return all;
}

/// At which a minute has most sets.
FrameRate TakeWriter::fastest() const {
  FrameRate fastest = place_.rate;
  for (const FinishedSegment& segment : finished_) {
    if (segment.tally.rate().period() < fastest.period()) fastest = segment.tally.rate();
  }
  return fastest;
}

bool TakeWriter::may_be_deleted(const FinishedSegment& segment, const std::vector<take::Manifest::Mark>& marks) const {
  return !near_mark(segment.first_set, segment.first_set + segment.sets - 1, marks, fastest());
}

std::uint64_t TakeWriter::deletable_bytes() const {
  const std::vector<take::Manifest::Mark> all = marks();
  std::uint64_t bytes = 0;
  for (const FinishedSegment& segment : finished_) bytes += may_be_deleted(segment, all) ? bytes_of(segment) : 0;
  return bytes;
}

Result<std::optional<std::uint64_t>> TakeWriter::delete_oldest() {
  const std::vector<take::Manifest::Mark> all = marks();
  const auto oldest =
      std::ranges::find_if(finished_, [&](const FinishedSegment& segment) { return may_be_deleted(segment, all); });
  if (oldest == finished_.end()) return std::optional<std::uint64_t>();
  const std::uint64_t bytes = bytes_of(*oldest);
  const std::uint32_t number = oldest->number;
  finished_.erase(oldest);  // first: if not all of its files can be removed, the take goes on without them
  NODAL_TRY(remove_segment(*place_.disk, place_.folder, number));
  return std::optional(bytes);
}

Status TakeWriter::sync(Instant now, std::int64_t utc_ns) {
  Status synced = place_.disk->sync_all();
  unsynced_ = false;
  if (synced && segment_) {
    const Status noted = segment_->note_durable(now, utc_ns);
    failed_ = failed_ || !noted;
    return noted;
  }
  if (!synced) close_flight();  // after a failed sync its durable length is unknown
  if (!synced && segment_) {
    segment_.reset();
    place_.after_error = true;
    to_cut_ = Trust::kDurable;
    (void)cut_segment("sync failed");  // tried again before anything is written after it
  }
  return synced;
}

/// Until this has worked the take has neither a further segment nor a manifest, because they would say that nothing is
/// missing.
Status TakeWriter::cut_segment(const std::string& reason) {
  if (!to_cut_) return {};
  NODAL_TRY_ASSIGN(auto done, recover_segment(place_, next_segment_ - 1, *to_cut_, reason));
  to_cut_.reset();
  if (done) add(std::move(*done));
  return {};
}

Status TakeWriter::mark(const std::string& text, Instant now) {
  if (marks().size() >= take::kMaxMarks) {
    return fail(Errc::kTooLarge,
                fmt::format("take {} has {} marks, the most that there may be", place_.number, take::kMaxMarks));
  }
  if (!segment_) {
    early_marks_.push_back({text, now});
    return {};
  }
  unsynced_ = true;
  const Status marked = segment_->mark(text, now);
  failed_ = failed_ || !marked;
  return marked;
}

Status TakeWriter::use_calibration(const TakeCalibration& calibration) {
  const std::vector<std::uint8_t> id(calibration.id.begin(), calibration.id.end());
  if (id == place_.calibration_id || left_out_calibrations()) return {};
  std::string name;  // empty: not stored
  if (place_.calibrations.size() < take::kMaxCalibrations) {
    name = take::calibration_file(place_.calibrations.size() + 1);
    NODAL_TRY(create_durably(*place_.disk, place_.folder, place_.folder + "/" + name, calibration.json));
  }
  place_.calibration_id = id;
  place_.calibration_json = calibration.json;
  place_.calibrations.push_back({name, to_hex(calibration.id), calibration.first_set});
  if (!segment_) return {};
  unsynced_ = true;
  const Status noted = segment_->note(place_.calibrations.back());
  failed_ = failed_ || !noted;
  return noted;
}

Result<take::Manifest> TakeWriter::end(const std::string& reason, SetCounts counts) {
  if (segment_ && !failed_) {
    if (const Status finished = finish_segment(reason); !finished) failed_ = true;
  }
  if (segment_) {
    segment_.reset();
    to_cut_ = Trust::kChecked;
  }
  NODAL_TRY(cut_segment(reason));
  ManifestSum sum(place_.number, reason, heads_);
  for (const FinishedSegment& segment : finished_) sum.add(segment);
  take::Manifest manifest = sum.finish(finished_sets_);
  manifest.calibrations = place_.calibrations;
  // The evidence does not know of those after the last set, nor of those before a segment that was deleted.
  take::Gap rest;
  const std::uint64_t lost = counts.given - std::min(counts.given, finished_sets_);
  rest.slow = counts.slow - std::min(counts.slow, manifest.gaps.slow);
  rest.error = lost - std::min(lost, manifest.gaps.error);
  if (rest.sets() != 0) take::add(manifest.gaps, rest);
  manifest.lost_sets = manifest.gaps.slow + manifest.gaps.error;
  NODAL_TRY_ASSIGN(auto flight, finish_flight());
  if (flight) manifest.files.push_back(std::move(*flight));
  return write_manifest(*place_.disk, place_.folder, std::move(manifest));
}

}  // namespace nodal::firmware
