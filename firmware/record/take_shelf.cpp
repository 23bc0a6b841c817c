#include "firmware/record/take_shelf.h"

#include <fmt/format.h>

#include "firmware/record/stored_documents.h"
#include "firmware/storage/durable_file.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {
namespace {

Error explained(Error error) {
  if (error.code != Errc::kBusy) return error;
  return {Errc::kBusy,
          "another nodald uses the takes folder; stop it, or give this rig a folder of its own ([takes] folder)"};
}

Error ejected_error() {
  return {Errc::kNotReady,
          "the disk of the takes was ejected and can be removed; `nodal take start` uses it again, and so does "
          "mounting it, "
          "or another one, anew"};
}

/// Removes the files of a take and its folder. Symbolic links are removed, not what they lead to.
Status empty_folder(hal::DiskPort& disk, std::uint64_t take) {
  const std::string folder = take::take_folder(take);
  NODAL_TRY_ASSIGN(const auto entries, disk.entries(folder));
  for (const hal::FolderEntry& entry : entries) {
    if (entry.kind != hal::EntryKind::kFolder) continue;
    return fail(
        Errc::kWrongState,
        fmt::format("take {} holds a folder, {}/{}, which is no part of a take, so nothing is deleted; move it away",
                    take, folder, entry.name));
  }
  // While this file is there, the next start goes on. On a disk without room for it, the take is deleted as well.
  const std::string mark = folder + "/" + take::kDeletedFile;
  const Status marked = write_durably(disk, folder, mark, "");
  if (!marked && marked.error().code != Errc::kDiskFull) return marked;
  for (const hal::FolderEntry& entry : entries) {
    if (entry.name == take::kDeletedFile) continue;
    const Status removed = disk.remove(folder + "/" + entry.name);
    if (!removed && removed.error().code != Errc::kNotFound) return removed;
  }
  if (marked) {
    NODAL_TRY(disk.sync_folder(folder));
    NODAL_TRY(disk.remove(mark));
  }
  return disk.remove(folder);
}

}  // namespace

Result<TakeShelf::Hold> TakeShelf::hold() {
  if (holds_ > 0) return Hold(*this);
  if (ejected_) return fail(ejected_error());
  if (const Status claimed = disk_.claim(); !claimed) return fail(explained(claimed.error()));
  if (const Status read = refresh(); !read) {
    disk_.release();
    return fail(read.error());
  }
  return Hold(*this);
}

void TakeShelf::forget() {
  takes_.clear();
  unread_.clear();
  recovery_.forget_all();
  half_deleted_.clear();
  numbers_.set_highest(0);
  leftover_ = false;
}

void TakeShelf::lose(const Error& why) {
  forget();
  identity_.reset();
  problem_ = why.message;
}

bool TakeShelf::watch() {
  if (holds_ > 0) return false;
  const bool first = !std::exchange(looked_, true);
  const auto now = disk_.identity();
  if (ejected_) {
    if (!now) ejected_->disk.reset();  // it was removed: when it comes again, it is a new disk
    if (!now || *now == ejected_->disk) return first;
    use_again();
  }
  if (!now) {
    const bool was_here = here();
    lose(now.error());
    return first || was_here;
  }
  if (identity_ == *now && unread_.empty()) return first;
  (void)refresh();  // its error is the problem
  return true;
}

Status TakeShelf::eject() {
  close();
  NODAL_ASSERT(holds_ == 0);
  NODAL_TRY_ASSIGN(const auto now, disk_.identity());
  in_use_.set_ejected(true);
  if (in_use_.is_read()) return fail(Errc::kBusy, "a take is being read; try again in a moment");
  if (const Status synced = disk_.sync_all(); !synced) {
    in_use_.set_ejected(false);
    return synced;
  }
  forget();
  identity_.reset();
  ejected_ = Ejected{now};
  problem_.clear();
  return {};
}

void TakeShelf::use_again() {
  ejected_.reset();
  in_use_.set_ejected(false);
}

Status TakeShelf::refresh() {
  if (ejected_) return fail(ejected_error());
  std::optional<std::uint64_t> now = identity_;
  if (holds_ == 0) {
    const auto found = disk_.identity();
    if (!found) {
      lose(found.error());
      return fail(found.error());
    }
    now = *found;
  }
  const auto entries = disk_.entries("");
  if (!entries) {
    if (holds_ == 0) lose(entries.error());
    return fail(entries.error());
  }
  const bool fresh = identity_ != now;
  if (fresh) {
    forget();
    identity_ = now;
    ++disks_;
  }
  problem_.clear();
  follow(*entries, fresh);
  numbers_.read_counter();
  return {};
}

void TakeShelf::begin(TakeEntry entry) {
  entry.state = TakeState::kRecording;
  takes_[entry.number] = std::move(entry);
}

Status TakeShelf::check_recording(std::uint64_t take) {
  NODAL_TRY_ASSIGN(const auto now, disk_.identity());
  if (identity_ != now) {
    return fail(Errc::kDeviceGone,
                "the disk was exchanged while the take was recorded; what was recorded is on the other one");
  }
  const auto checked = disk_.size(take::take_folder(take) + "/" + take::kTakeFile);
  if (!checked && checked.error().code == Errc::kNotFound) {
    return fail(Errc::kNotFound, "its folder was removed while it was recorded");
  }
  return {};
}

void TakeShelf::finish(std::uint64_t take, const Result<take::Manifest>& manifest) {
  const auto found = takes_.find(take);
  if (found == takes_.end()) return;  // it is on a disk that is no longer there
  TakeEntry& entry = found->second;
  if (manifest) {
    entry.complete(*manifest);
  } else {
    entry.state = TakeState::kUnfinished;
    entry.problem = manifest.error().message;
  }
  (void)refresh();
}

Status TakeShelf::protect(std::uint64_t take, bool on) {
  NODAL_TRY(hold());
  NODAL_TRY_ASSIGN(const auto entry, finished(take));
  const std::string folder = take::take_folder(take), file = folder + "/" + take::kProtectedFile;
  Status set = on ? write_durably(disk_, folder, file, "") : disk_.remove(file);
  if (!set && set.error().code == Errc::kNotFound && !on) set = {};
  if (set && !on) set = disk_.sync_folder(folder);
  if (set) entry->is_protected = on;
  return set;
}

Result<TakeEntry*> TakeShelf::finished(std::uint64_t take) {
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

Status TakeShelf::remove(std::uint64_t take, const std::optional<Sha256>& manifest) {
  NODAL_TRY(hold());
  NODAL_TRY_ASSIGN(const auto entry, finished(take));
  if (entry->is_protected) {
    return fail(Errc::kWrongState, fmt::format("take {0} is protected; first: nodal take protect {0} --off", take));
  }
  if (manifest) {
    NODAL_TRY_ASSIGN(const auto id, stored_manifest_id(disk_, take::take_folder(take)));
    if (id != *manifest) {
      return fail(Errc::kWrongState,
                  fmt::format("take {} has another manifest than the one named: it is not deleted; list takes again: "
                              "nodal take list",
                              take));
    }
  }
  NODAL_TRY(empty_folder(disk_, take));
  takes_.erase(take);
  recovery_.forget(take);
  return disk_.sync_folder("");
}

}  // namespace nodal::firmware
