// The part of TakeKeeper that knows the takes on the disk.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "firmware/record/recovery.h"
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
  const auto text = disk_.read(folder + "/" + take::kTakeFile, take::kMaxTakeJsonBytes);
  const auto about = text ? take::parse_take_json(text_of(*text), folder + "/" + take::kTakeFile)
                          : Result<take::TakeDocument>(fail(text.error()));
  if (about) {
    entry.started_utc_ns = about->started_utc_ns;
    entry.raymap_width = about->raymap_width;
    entry.raymap_height = about->raymap_height;
  }
  const auto stored = disk_.read(folder + "/" + take::kManifestFile, take::kMaxManifestBytes);
  if ((!stored && stored.error().code == Errc::kNotFound) || being_deleted(entry.number)) {
    entry.state = TakeState::kUnfinished;
    to_recover_.push_back(entry.number);
    return;
  }
  const auto manifest = stored ? take::parse_manifest(text_of(*stored), folder + "/" + take::kManifestFile)
                               : Result<take::Manifest>(fail(stored.error()));
  if (manifest) {
    entry.complete(*manifest);
  } else {
    entry.state = TakeState::kDamaged;
    entry.problem = manifest.error().message;
  }
}

bool TakeKeeper::recover_one() {
  if (to_recover_.empty()) return false;
  recover(takes_.at(to_recover_.back()));
  return true;
}

bool TakeKeeper::being_deleted(std::uint64_t take) {
  return disk_.size(take::take_folder(take) + "/" + take::kDeletedFile).has_value();
}

/// False if it held nothing, or was being deleted, and is gone.
bool TakeKeeper::recover(TakeEntry& entry) {
  std::erase(to_recover_, entry.number);
  const bool deleted = being_deleted(entry.number);
  if (const auto nothing = nothing_recorded(disk_, take::take_folder(entry.number)); deleted || (nothing && *nothing)) {
    const std::uint64_t number = entry.number;  // its entry goes
    entry.state = TakeState::kDamaged;          // if it cannot be removed
    entry.problem = deleted ? "the power failed while it was deleted; delete it again"
                            : "the power failed when it began; it holds nothing";
    return !remove({number});
  }
  const auto manifest = recover_take(disk_, take::take_folder(entry.number));
  if (manifest) {
    entry.complete(*manifest);
  } else {
    entry.state = TakeState::kDamaged;
    entry.problem = manifest.error().message;
  }
  return true;
}

Result<TakeEntry*> TakeKeeper::finished(std::uint64_t take) {
  const auto found = takes_.find(take);
  if (found == takes_.end())
    return fail(Errc::kNotFound, fmt::format("there is no take {}; `nodal take list` lists them", take));
  if (found->second.state == TakeState::kRecording) {
    return fail(Errc::kWrongState, fmt::format("take {} is being recorded; stop it first: nodal take stop", take));
  }
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
    const auto manifest = disk_.read(folder + "/" + take::kManifestFile, take::kMaxManifestBytes);
    if (!manifest) return fail(manifest.error());
    if (sha256(*manifest) != *what.manifest) {
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
  std::erase(to_recover_, take);
  return disk_.sync_folder("");
}

}  // namespace nodal::firmware
