// The part of TakeShelf that reads which takes are on the disk, and recovers those that were not finished.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "firmware/record/disk_test.h"
#include "firmware/record/stored_documents.h"
#include "firmware/record/take_shelf.h"
#include "hal/folder_listing.h"
#include "protocol/base/text.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {

static_assert(TakeShelf::kMaxTakeNumber == take::kMaxTakeNumber);
static_assert(TakeShelf::kMaxBytesAStep >= take::kMaxManifestBytes);
static_assert(hal::FolderListing::kMaxEntries > take::kMaxTakeFiles + TakeShelf::kMaxTakes, "each take can be listed");

namespace {

/// "000042" as a number; nothing for other names.
std::optional<std::uint64_t> number_of(const std::string& folder) {
  std::uint64_t number = 0;
  const char* const end = folder.data() + folder.size();
  const auto [stop, error] = std::from_chars(folder.data(), end, number);
  const bool whole = error == std::errc() && stop == end && take::take_folder(number) == folder;
  if (!whole || number >= TakeShelf::kMaxTakeNumber) return std::nullopt;
  return number;
}

/// Bytes that load() reads, at most.
std::uint64_t document_bytes(hal::DiskPort& disk, const std::string& folder) {
  const auto bytes = [&](const std::string& name, std::uint64_t most) {
    return std::min(disk.size(folder + "/" + name).value_or(0), most);
  };
  return bytes(take::kManifestFile, take::kMaxManifestBytes) + bytes(take::kTakeFile, take::kMaxTakeJsonBytes);
}

bool being_deleted(hal::DiskPort& disk, std::uint64_t take) {
  return disk.size(take::take_folder(take) + "/" + take::kDeletedFile).has_value();
}

}  // namespace

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

void TakeEntry::complete(const take::Manifest& manifest) {
  state = TakeState::kComplete;
  sets = manifest.sets;
  lost_sets = manifest.lost_sets;
  deleted_sets = manifest.deleted_sets;
  gaps = manifest.gaps;
  heads = manifest.heads;
  if (!manifest.rates.empty()) {  // else that of take.json
    rate = manifest.rates.front().rate;
    rates = manifest.rates.size();
  }
  bytes = manifest.bytes();
  length = manifest.length;
  ended = manifest.ended;
  problem.clear();
}

void TakeEntry::set_damaged(const Error& why) {
  state = TakeState::kDamaged;
  problem = printable(why.message, TakeShelf::kMaxProblemBytes);
}

/// Makes the list that of these entries of the disk's root. `fresh`: of a disk that was not there before.
void TakeShelf::follow(const std::vector<hal::FolderEntry>& entries, bool fresh) {
  std::map<std::uint64_t, const hal::FolderEntry*> found;
  for (const hal::FolderEntry& entry : entries) {
    if (const auto number = number_of(entry.name)) found[*number] = &entry;
  }
  leftover_ |= fresh && std::ranges::count(entries, DiskTest::kFile, &hal::FolderEntry::name) > 0;
  numbers_.set_highest(found.empty() ? 0 : found.rbegin()->first);
  std::erase_if(takes_, [&](const auto& each) {
    const bool gone = !found.contains(each.first) && !recovery_.is_running(each.first);
    if (gone) recovery_.forget(each.first);
    return gone;
  });
  std::erase_if(unread_, [&](const auto& each) { return !takes_.contains(each.first); });
  std::erase_if(half_deleted_, [&](std::uint64_t take) { return !takes_.contains(take); });
  std::uint64_t read = 0;
  for (const auto& [number, entry] : found) {
    const auto known = takes_.find(number);
    if (known == takes_.end() && is_full()) continue;
    const bool recording =
        recovery_.is_running(number) || (known != takes_.end() && known->second.state == TakeState::kRecording);
    const bool same = known != takes_.end() && known->second.version == entry->version;
    if (recording || same) continue;
    const std::uint64_t bytes = document_bytes(disk_, entry->name);
    if (read > 0 && read + bytes > kMaxBytesAStep) {
      leave_unread(number, *entry, fresh);
      continue;
    }
    read += bytes;
    const auto waited = unread_.extract(number);
    load(number, *entry, waited ? waited.mapped() : fresh);
  }
  if (!has_work()) contested_.clear();
}

void TakeShelf::leave_unread(std::uint64_t number, const hal::FolderEntry& folder, bool fresh) {
  TakeEntry& entry = takes_[number];
  entry = {};
  entry.number = number;
  entry.version = ~folder.version;  // so that the next look reads it
  entry.is_protected = disk_.size(folder.name + "/" + take::kProtectedFile).has_value();
  entry.state = TakeState::kUnfinished;
  entry.problem = "it has not been read yet, because the disk has takes with very large manifests; list takes again";
  unread_.try_emplace(number, fresh);
}

void TakeShelf::load(std::uint64_t number, const hal::FolderEntry& folder, bool fresh) {
  std::optional<TakeEntry> before;
  if (const auto known = takes_.find(number); known != takes_.end()) before = known->second;
  TakeEntry& entry = takes_[number];
  entry = {};
  entry.number = number;
  entry.version = folder.version;
  if (folder.kind != hal::EntryKind::kFolder) {
    return entry.set_damaged({Errc::kIo, folder.name + " is not a folder, so it is left alone; remove it by hand"});
  }
  entry.is_protected = disk_.size(folder.name + "/" + take::kProtectedFile).has_value();
  if (const auto about = stored_take_json(disk_, folder.name)) {
    entry.started_utc_ns = about->started_utc_ns;
    entry.raymap_width = about->raymap_width;
    entry.raymap_height = about->raymap_height;
    entry.rate = about->rate;
    entry.rates = 1;
  }
  const bool half_deleted = being_deleted(disk_, number);
  const auto manifest = stored_manifest(disk_, folder.name);
  if (half_deleted || (!manifest && manifest.error().code == Errc::kNotFound)) {
    return load_unfinished(entry, before, half_deleted, fresh);
  }
  recovery_.forget(number);
  if (manifest) entry.complete(*manifest);
  else entry.set_damaged(manifest.error());
}

/// One that comes to a disk that nodald uses already may still be copied there by somebody, or recorded by another
/// nodald.
void TakeShelf::load_unfinished(TakeEntry& entry, const std::optional<TakeEntry>& before, bool half_deleted,
                                bool fresh) {
  entry.state = TakeState::kUnfinished;
  if (fresh && half_deleted) {
    half_deleted_.push_back(entry.number);
  } else if (fresh) {
    if (const auto reason = set_aside_reason(disk_, entry.number)) {
      (void)note({entry.number, TakeRecovery::Outcome::kSetAside, *reason});
    } else {
      recovery_.add(entry.number);
    }
  } else if (before && before->state != TakeState::kComplete) {
    entry.state = before->state;
    entry.problem = before->problem;
  } else {
    entry.problem =
        "it came to the disk while nodald runs, or is being copied there; if it stays unfinished, start nodald again, "
        "which then recovers it";
  }
}

bool TakeShelf::recover_some(Instant now, bool begin) {
  if (!recovering_) {
    if (!has_work() || !begin || now < try_again_at_) return false;
    auto held = hold();
    if (!held) {
      if (held.error().code == Errc::kBusy) contested_ = held.error().message;
      try_again_at_ = now + kTryAgainAfter;
      return false;
    }
    contested_.clear();
    recovering_.emplace(std::move(*held));
  }
  bool did = begin;
  if (begin && std::exchange(leftover_, false)) {
    DiskTest::remove_leftover(disk_);
  } else if (begin && !half_deleted_.empty()) {
    (void)remove_rest(half_deleted_.back());
  } else {
    const auto done = recovery_.step(begin);
    if (done) (void)note(*done);
    did = done.has_value();
  }
  if (!has_work()) recovering_.reset();
  return did;
}

/// True if the take is complete now.
bool TakeShelf::note(const TakeRecovery::Done& done) {
  TakeEntry& entry = takes_.at(done.take);
  entry.state = TakeState::kDamaged;
  entry.problem = printable(done.problem, kMaxProblemBytes);
  switch (done.outcome) {
    case TakeRecovery::Outcome::kFailed: break;
    case TakeRecovery::Outcome::kNothing:
      entry.problem = "the power failed when it began; it holds nothing";  // if it cannot be removed
      (void)remove(done.take);
      break;
    case TakeRecovery::Outcome::kSetAside:
      entry.state = TakeState::kSetAside;
      set_aside_ = fmt::format("take {} is set aside, because its recovery failed twice: {}; the rig runs without it",
                               done.take, done.problem);
      break;
    case TakeRecovery::Outcome::kRecovered: {
      const auto manifest = stored_manifest(disk_, take::take_folder(done.take));
      if (manifest) entry.complete(*manifest);
      else entry.set_damaged(manifest.error());
      return manifest.has_value();
    }
  }
  return false;
}

/// Deletes what is left of a take that was being deleted.
bool TakeShelf::remove_rest(std::uint64_t take) {
  std::erase(half_deleted_, take);
  TakeEntry& entry = takes_.at(take);
  entry.state = TakeState::kDamaged;  // if it cannot be removed
  entry.problem = "the power failed while it was deleted; delete it again";
  return remove(take).has_value();
}

/// True if the take is complete now. Where takes are recovered beside the stage, it may be later.
bool TakeShelf::recover(TakeEntry& entry) {
  const std::uint64_t take = entry.number;  // its entry may go
  if (std::ranges::find(half_deleted_, take) != half_deleted_.end()) {
    (void)remove_rest(take);
    return false;
  }
  const auto done = recovery_.recover(take);
  if (recovery_.is_running(take) && !recovering_) recovering_.emplace(*this);
  return done && note(*done);
}

void TakeShelf::close() {
  recovery_.close();
  recovering_.reset();
}

}  // namespace nodal::firmware
