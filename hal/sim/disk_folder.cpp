// The part of SimDisk that concerns the folder itself and the names in it.
#include <algorithm>
#include <utility>

#include "hal/folder_listing.h"
#include "hal/sim/disk.h"
#include "hal/sim/disk_inode.h"
#include "protocol/base/try.h"

namespace nodal::hal::sim {

Status SimDisk::claim_for(const void* port) {
  NODAL_TRY(answers(""));
  if (claimed_by_ && claimed_by_ != port) return fail(Errc::kBusy, "folder '': another nodald uses it");
  claimed_by_ = port;
  return {};
}

void SimDisk::release_for(const void* port) {
  if (claimed_by_ == port) claimed_by_ = nullptr;
}

Result<std::uint64_t> SimDisk::identity() {
  NODAL_TRY(answers(""));
  return identity_;
}

void SimDisk::put(const std::string& name, std::span<const std::uint8_t> bytes) {
  (void)remove(name);
  const auto file = create(name);
  const bool done = file && write(*file, bytes) && sync(*file);
  NODAL_ASSERT(done);
  close(*file);
}

void SimDisk::put_link(const std::string& name) {
  auto inode = std::make_shared<Inode>();
  inode->link = true;
  commit({{{name, std::move(inode)}}});
}

void SimDisk::put_second_name(const std::string& file, const std::string& name) { commit({{{name, tree_.at(file)}}}); }

Status SimDisk::rename_as(const std::string& from, const std::string& to, bool replaces) {
  NODAL_TRY(begin("renaming it", from));
  if (!is_file_name(from)) return fail(bad_name(from));
  NODAL_TRY(check_parent(to));
  NODAL_TRY(check_no_link(parent_of(from)));
  const auto found = tree_.find(from);
  if (found == tree_.end()) return fail(not_there(from));
  const auto target = tree_.find(to);
  if (!replaces && target != tree_.end()) return fail(name_taken(to));
  if (found->second->folder || (target != tree_.end() && target->second->folder)) {
    return fail(Errc::kUnsupported, "file '" + from + "': folders are not renamed or replaced");
  }
  if (from != to) commit({{{to, found->second}, {from, nullptr}}});
  if (dying()) return fail(no_power(from));
  return {};
}

Status SimDisk::rename(const std::string& from, const std::string& to) { return rename_as(from, to, true); }

Status SimDisk::rename_new(const std::string& from, const std::string& to) { return rename_as(from, to, false); }

Status SimDisk::remove(const std::string& name) {
  NODAL_TRY(begin("removing it", name));
  if (!is_file_name(name)) return fail(bad_name(name));
  NODAL_TRY(check_no_link(parent_of(name)));
  const auto found = tree_.find(name);
  if (found == tree_.end()) return fail(not_there(name));
  if (found->second->folder) {
    const auto next = std::next(found);
    // A folder's entries sort directly after it, except for names that continue with a character below '/'.
    const bool full = std::any_of(next, tree_.end(), [&](const auto& entry) { return inside(entry.first, name); });
    if (full) return fail(Errc::kExists, "file '" + name + "': is a folder with files in it");
  }
  commit({{{name, nullptr}}});
  if (dying()) return fail(no_power(name));
  return {};
}

Status SimDisk::make_folder(const std::string& name) {
  NODAL_TRY(begin("making it", name));
  NODAL_TRY(check_parent(name));
  if (tree_.contains(name)) return fail(name_taken(name));
  auto inode = std::make_shared<Inode>();
  inode->folder = true;
  commit({{{name, std::move(inode)}}});
  if (dying()) return fail(no_power(name));
  return {};
}

Status SimDisk::sync_folder(const std::string& name) {
  NODAL_TRY(begin("syncing it", name));
  if (!name.empty()) {
    if (!is_file_name(name)) return fail(bad_name(name));
    const auto found = tree_.find(name);
    if (found == tree_.end()) return fail(not_there(name));
    if (!found->second->folder) return fail(Errc::kIo, "file '" + name + "': is not a folder");
  }
  for (std::size_t k = 0; k < unsynced_.size();) {
    const auto& entries = unsynced_[k].entries;
    const bool here =
        std::any_of(entries.begin(), entries.end(), [&](const auto& entry) { return parent_of(entry.first) == name; });
    if (here && (!dying() || random_.below(2) == 1)) {
      make_last(k);
    } else {
      ++k;
    }
  }
  if (dying()) return fail(no_power(name));
  return {};
}

Result<std::vector<std::string>> SimDisk::list(const std::string& folder) {
  NODAL_TRY_ASSIGN(auto found, entries(folder));
  return FolderListing::names_of(std::move(found));
}

Result<std::vector<FolderEntry>> SimDisk::entries(const std::string& folder) {
  NODAL_TRY(answers(folder));
  if (!folder.empty()) {
    if (!is_file_name(folder)) return fail(bad_name(folder));
    NODAL_TRY(check_no_link(folder));
    const auto found = tree_.find(folder);
    if (found == tree_.end()) return fail(not_there(folder));
    if (!found->second->folder) return fail(Errc::kIo, "file '" + folder + "': is not a folder");
  }
  FolderListing found(folder);
  for (const auto& [name, inode] : tree_) {
    if (parent_of(name) != folder) continue;
    const EntryKind kind = inode->link ? EntryKind::kOther : inode->folder ? EntryKind::kFolder : EntryKind::kFile;
    const std::string entry = name.substr(folder.empty() ? 0 : folder.size() + 1);
    NODAL_TRY(found.add({entry, kind, inode->version}));
  }
  return std::move(found).entries();
}

Result<std::uint64_t> SimDisk::free_bytes() {
  NODAL_TRY(answers(""));
  const std::uint64_t in_use = used();
  return capacity_ > in_use ? capacity_ - in_use : 0;
}

Result<std::uint64_t> SimDisk::total_bytes() {
  NODAL_TRY(answers(""));
  return capacity_;
}

}  // namespace nodal::hal::sim
