// The part of TakeKeeper that knows the takes on the disk.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "firmware/record/stored_documents.h"
#include "firmware/record/take_keeper.h"
#include "firmware/storage/durable_file.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {
namespace {

/// "000042" as a number; nothing for other names.
std::optional<std::uint64_t> number_of(const std::string& folder) {
  std::uint64_t number = 0;
  const char* const end = folder.data() + folder.size();
  const auto [stop, error] = std::from_chars(folder.data(), end, number);
  if (error != std::errc() || stop != end || take::take_folder(number) != folder) return std::nullopt;
  if (number > take::kMaxTakeNumber) return std::nullopt;  // of no rig
  return number;
}

std::string_view text_of(const std::vector<std::uint8_t>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

void TakeEntry::complete(const take::Manifest& manifest) {
  state = TakeState::kComplete;
  sets = manifest.sets;
  lost_sets = manifest.lost_sets;
  deleted_sets = manifest.deleted_sets;
  gaps = manifest.gaps;
  heads = manifest.heads;
  if (!manifest.rates.empty()) rates = manifest.rates;  // else that of take.json
  bytes = manifest.bytes();
  length = manifest.length;
  ended = manifest.ended;
  problem.clear();
}

/// Reads which takes there are. Errors are in loaded_status_: then nothing can be recorded.
void TakeKeeper::load() {
  DiskTest::remove_leftover(disk_);
  const auto names = disk_.list("");
  if (!names) {
    loaded_status_ = fail(names.error());
    report_.problem = names.error().message;
    return;
  }
  for (const std::string& name : *names) {
    if (number_of(name) && takes_.size() < kMostTakes) load(name);
  }
  if (const auto text = disk_.read(kNextTakeFile, 64)) {
    std::uint64_t next = 0;
    std::from_chars(text_of(*text).data(), text_of(*text).data() + text->size(), next);
    next_take_ = std::max(next_take_, std::min<std::uint64_t>(next, std::uint64_t{1} << 40));
  }
  if (!takes_.empty()) next_take_ = std::max(next_take_, takes_.rbegin()->first + 1);
}

void TakeKeeper::load(const std::string& folder) {
  TakeEntry& entry = takes_[*number_of(folder)];
  entry.number = *number_of(folder);
  entry.is_protected = disk_.size(folder + "/" + take::kProtectedFile).has_value();
  if (const auto about = stored_take_json(disk_, folder)) {
    entry.started_utc_ns = about->started_utc_ns;
    entry.raymap_width = about->raymap_width;
    entry.raymap_height = about->raymap_height;
    entry.rates = {{0, about->rate}};
  }
  if (being_deleted(entry.number)) {
    entry.state = TakeState::kUnfinished;
    half_deleted_.push_back(entry.number);
    return;
  }
  const auto manifest = stored_manifest(disk_, folder);
  if (manifest) {
    entry.complete(*manifest);
  } else if (manifest.error().code != Errc::kNotFound) {
    entry.state = TakeState::kDamaged;
    entry.problem = manifest.error().message;
  } else if (const auto reason = set_aside_reason(disk_, entry.number)) {
    (void)note({entry.number, TakeRecovery::Outcome::kSetAside, *reason});
  } else {
    entry.state = TakeState::kUnfinished;
    recovery_.add(entry.number);
  }
}

/// `begin`: there is nothing else to do.
bool TakeKeeper::recover_some(bool begin) {
  if (begin && !half_deleted_.empty()) {
    (void)remove_rest(half_deleted_.back());
    return true;
  }
  const auto done = recovery_.step(begin);
  if (done) (void)note(*done);
  return done.has_value();
}

/// True if the take is complete now.
bool TakeKeeper::note(const TakeRecovery::Done& done) {
  TakeEntry& entry = takes_.at(done.take);
  entry.state = TakeState::kDamaged;
  entry.problem = done.problem;
  switch (done.outcome) {
    case TakeRecovery::Outcome::kFailed: break;
    case TakeRecovery::Outcome::kNothing:
      entry.problem = "the power failed when it began; it holds nothing";  // if it cannot be removed
      (void)remove({done.take});
      break;
    case TakeRecovery::Outcome::kSetAside:
      entry.state = TakeState::kSetAside;
      report_.problem =
          fmt::format("take {} is set aside, because its recovery failed twice: {}; the rig runs without it", done.take,
                      done.problem);
      break;
    case TakeRecovery::Outcome::kRecovered: {
      const auto manifest = stored_manifest(disk_, take::take_folder(done.take));
      if (manifest) entry.complete(*manifest);
      else entry.problem = manifest.error().message;
      return manifest.has_value();
    }
  }
  return false;
}

bool TakeKeeper::being_deleted(std::uint64_t take) {
  return disk_.size(take::take_folder(take) + "/" + take::kDeletedFile).has_value();
}

/// Deletes what is left of a take that was being deleted.
bool TakeKeeper::remove_rest(std::uint64_t take) {
  std::erase(half_deleted_, take);
  TakeEntry& entry = takes_.at(take);
  entry.state = TakeState::kDamaged;  // if it cannot be removed
  entry.problem = "the power failed while it was deleted; delete it again";
  return remove({take}).has_value();
}

/// True if the take is complete now. Where takes are recovered beside this stage, it may be later.
bool TakeKeeper::recover(TakeEntry& entry) {
  if (being_deleted(entry.number)) {
    (void)remove_rest(entry.number);
    return false;
  }
  const auto done = recovery_.recover(entry.number);
  return done && note(*done);
}

Result<TakeEntry*> TakeKeeper::finished(std::uint64_t take) {
  const auto found = takes_.find(take);
  if (found == takes_.end())
    return fail(Errc::kNotFound, fmt::format("there is no take {}; `nodal take list` lists them", take));
  if (found->second.state == TakeState::kRecording) {
    return fail(Errc::kWrongState, fmt::format("take {} is being recorded; stop it first: nodal take stop", take));
  }
  if (recovery_.is_running(take))
    return fail(Errc::kBusy, fmt::format("take {} is being recovered; try again in a moment", take));
  return &found->second;
}

Status TakeKeeper::remove(const TakeRequest::Delete& what) {
  const std::uint64_t take = what.take;
  const auto entry = finished(take);
  if (!entry) return fail(entry.error());
  if ((*entry)->is_protected) {
    return fail(Errc::kWrongState, fmt::format("take {0} is protected; first: nodal take protect {0} --off", take));
  }
  const std::string folder = take::take_folder(take);
  if (what.manifest) {
    const auto id = stored_manifest_id(disk_, folder);
    if (!id) return fail(id.error());
    if (*id != *what.manifest) {
      return fail(Errc::kWrongState,
                  fmt::format("take {} has another manifest than the one named: it is not deleted; list takes again: "
                              "nodal take list",
                              take));
    }
  }
  const auto names = disk_.list(folder);
  if (!names) return fail(names.error());
  // While this file is there, the next start goes on. On a disk without room for it, the take is deleted as well.
  const std::string mark = folder + "/" + take::kDeletedFile;
  const Status marked = write_durably(disk_, folder, mark, "");
  if (!marked && marked.error().code != Errc::kDiskFull) return marked;
  for (const std::string& name : *names) {
    if (name == take::kDeletedFile) continue;
    if (const Status removed = disk_.remove(folder + "/" + name); !removed) return removed;
  }
  if (marked) {
    if (const Status synced = disk_.sync_folder(folder); !synced) return synced;
    if (const Status removed = disk_.remove(mark); !removed) return removed;
  }
  if (const Status removed = disk_.remove(folder); !removed) return removed;
  takes_.erase(take);
  recovery_.forget(take);
  return disk_.sync_folder("");
}

}  // namespace nodal::firmware
