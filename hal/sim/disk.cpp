#include "hal/sim/disk.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "hal/file_name.h"
#include "hal/sim/disk_inode.h"
#include "protocol/base/try.h"

namespace nodal::hal::sim {

SimDisk::SimDisk(std::uint64_t seed, std::uint64_t capacity_bytes)
    : random_(seed, "disk"), identity_(Random(seed, "identity").next()), capacity_(capacity_bytes) {}
SimDisk::~SimDisk() = default;

/// No part of the name may be a symbolic link.
Status SimDisk::check_no_link(const std::string& name) const {
  for (std::size_t end = name.find('/');; end = name.find('/', end + 1)) {
    const auto found = tree_.find(name.substr(0, end));
    if (found != tree_.end() && found->second->link) {
      return fail(Errc::kBadValue,
                  "file '" + name + "': is a symbolic link, or leads through one, which is not followed");
    }
    if (end == std::string::npos) return {};
  }
}

Status SimDisk::check_parent(const std::string& name) const {
  if (!is_file_name(name)) return fail(bad_name(name));
  NODAL_TRY(check_no_link(parent_of(name)));
  const std::string parent = parent_of(name);
  if (parent.empty()) return {};
  const auto found = tree_.find(parent);
  if (found == tree_.end() || !found->second->folder) {
    return fail(Errc::kNotFound, "file '" + name + "': its folder is not there; make it first");
  }
  return {};
}

/// Applies a change, which the program sees at once. While the power fails, it is applied or not.
void SimDisk::commit(Change change) {
  if (dying() && random_.below(2) == 0) return;
  for (const auto& [name, inode] : change.entries) {
    const auto parent = tree_.find(parent_of(name));
    if (parent != tree_.end()) parent->second->version = ++changes_;
    if (inode) {
      inode->version = ++changes_;
      tree_[name] = inode;
    } else {
      tree_.erase(name);
    }
  }
  unsynced_.push_back(std::move(change));
}

/// Makes change k durable; older changes of its names no longer matter.
void SimDisk::make_last(std::size_t k) {
  const Change change = unsynced_[k];
  unsynced_.erase(unsynced_.begin() + static_cast<std::ptrdiff_t>(k));
  for (const auto& [name, inode] : change.entries) {
    if (inode) {
      lasting_[name] = inode;
    } else {
      lasting_.erase(name);
    }
    for (std::size_t older = 0; older < k; ++older) {
      std::erase_if(unsynced_[older].entries, [&changed = name](const auto& entry) { return entry.first == changed; });
    }
  }
}

Result<FileHandle> SimDisk::hand_out(InodePtr inode, const std::string& name, bool to_read) {
  const FileHandle handle = next_handle_++;
  handles_[handle] = {std::move(inode), name, to_read};
  return handle;
}

Result<SimDisk::Handle*> SimDisk::handle_of(FileHandle file, bool to_read) {
  const auto found = handles_.find(file);
  if (found == handles_.end()) return fail(Errc::kWrongState, fmt::format("file handle {}: is not open", file));
  if (found->second.to_read != to_read) {
    return fail(Errc::kWrongState, "file '" + found->second.name + "': is open to be " +
                                       (to_read ? "written" : "read") + ", not to be " +
                                       (to_read ? "read" : "written"));
  }
  return &found->second;
}

Result<FileHandle> SimDisk::create(const std::string& name) {
  NODAL_TRY(begin("creating it", name));
  NODAL_TRY(check_parent(name));
  if (tree_.contains(name)) return fail(name_taken(name));
  auto inode = std::make_shared<Inode>();
  commit({{{name, inode}}});
  if (dying()) return fail(no_power(name));
  return hand_out(std::move(inode), name);
}

Result<FileHandle> SimDisk::open_append(const std::string& name) {
  NODAL_TRY(begin("opening it", name));
  if (!is_file_name(name)) return fail(bad_name(name));
  NODAL_TRY(check_no_link(name));
  const auto found = tree_.find(name);
  if (found == tree_.end()) return fail(not_there(name));
  if (found->second->folder) return fail(Errc::kIo, "file '" + name + "': is a folder");
  const auto same = [&](const auto& entry) { return entry.second == found->second; };
  if (std::count_if(tree_.begin(), tree_.end(), same) > 1) {
    return fail(Errc::kBadValue, "file '" + name + "': has other names, too (hard links), whose bytes would change");
  }
  if (dying()) return fail(no_power(name));
  return hand_out(found->second, name);
}

Result<FileHandle> SimDisk::open_read(const std::string& name) {
  NODAL_TRY(size(name));
  return hand_out(tree_.at(name), name, true);
}

Result<std::size_t> SimDisk::read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) {
  NODAL_TRY_ASSIGN(const auto handle, handle_of(file, true));
  NODAL_TRY(begin_read(handle->name, offset + bytes.size()));
  const std::vector<std::uint8_t>& data = handle->inode->bytes;
  if (offset >= data.size()) return 0;
  const std::size_t count = std::min<std::uint64_t>(bytes.size(), data.size() - offset);
  std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(offset), count, bytes.begin());
  return count;
}

Status SimDisk::write(FileHandle file, std::span<const std::uint8_t> bytes) {
  return write_pieces(file, std::span(&bytes, 1));
}

Status SimDisk::write_pieces(FileHandle file, std::span<const std::span<const std::uint8_t>> pieces) {
  NODAL_TRY_ASSIGN(const auto handle, handle_of(file, false));
  const std::string& name = handle->name;
  NODAL_TRY(begin("writing it", name));
  std::vector<std::uint8_t>& data = handle->inode->bytes;
  std::size_t bytes = 0;
  for (const auto& piece : pieces) bytes += piece.size();
  const std::uint64_t in_use = used();
  const std::uint64_t room = capacity_ > in_use ? capacity_ - in_use : 0;
  std::size_t fits = dying() ? static_cast<std::size_t>(random_.below(bytes + 1))
                             : static_cast<std::size_t>(std::min<std::uint64_t>(room, bytes));
  write_for(bytes);
  const bool all = fits == bytes;
  for (const auto& piece : pieces) {
    const std::size_t part = std::min(fits, piece.size());
    data.insert(data.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(part));
    fits -= part;
  }
  if (dying()) return fail(no_power(name));
  if (!all) return fail(Errc::kDiskFull, "file '" + name + "': the disk is full; make room and try again");
  return {};
}

Status SimDisk::overwrite(FileHandle file, std::uint64_t offset, std::span<const std::uint8_t> bytes) {
  NODAL_TRY_ASSIGN(const auto handle, handle_of(file, false));
  NODAL_TRY(begin("writing it", handle->name));
  Inode& inode = *handle->inode;
  if (bytes.empty()) return {};
  if (offset > inode.bytes.size() || bytes.size() > inode.bytes.size() - offset ||
      offset / kSector != (offset + bytes.size() - 1) / kSector) {
    return fail(Errc::kBadValue, "file '" + handle->name + "': only bytes of one sector are replaced");
  }
  if (dying() && random_.below(2) == 0) return fail(no_power(handle->name));
  const auto at = inode.bytes.begin() + static_cast<std::ptrdiff_t>(offset);
  inode.replaced.emplace_back(offset, std::vector(at, at + static_cast<std::ptrdiff_t>(bytes.size())));
  std::ranges::copy(bytes, at);
  if (dying()) return fail(no_power(handle->name));
  return {};
}

Status SimDisk::truncate(FileHandle file, std::uint64_t size) {
  NODAL_TRY_ASSIGN(const auto handle, handle_of(file, false));
  NODAL_TRY(begin("shortening it", handle->name));
  Inode& inode = *handle->inode;
  if (size > inode.bytes.size()) {
    return fail(Errc::kBadValue, fmt::format("file '{}': is shorter than {}", handle->name, size));
  }
  if (dying() && random_.below(2) == 0) return fail(no_power(handle->name));
  if (size < inode.synced) {
    if (!inode.before_cut)
      inode.before_cut.emplace(inode.bytes.begin(), inode.bytes.begin() + static_cast<std::ptrdiff_t>(inode.synced));
    inode.synced = size;
  }
  inode.bytes.resize(size);
  std::erase_if(inode.replaced, [&](const auto& each) { return each.first + each.second.size() > size; });
  if (dying()) return fail(no_power(handle->name));
  return {};
}

void SimDisk::start_write_out(FileHandle) {}
void SimDisk::preallocate(FileHandle, std::uint64_t) {}

void SimDisk::make_durable(Inode& inode) {
  if (inode.lost) return;
  inode.synced = inode.bytes.size();
  inode.replaced.clear();
  inode.before_cut.reset();
}

Status SimDisk::sync(FileHandle file) {
  const auto found = handles_.find(file);
  if (found == handles_.end()) return fail(Errc::kWrongState, fmt::format("file handle {}: is not open", file));
  const std::string& name = found->second.name;
  NODAL_TRY(begin("syncing it", name));
  Inode& inode = *found->second.inode;
  if (sync_fails()) {
    inode.lost = true;
    return fail(Errc::kIo, "file '" + name + "': syncing it failed: the disk reports an error");
  }
  if (!dying() || random_.below(2) == 1) make_durable(inode);
  if (dying()) return fail(no_power(name));
  return {};
}

Status SimDisk::sync_all() {
  NODAL_TRY(begin("syncing all", ""));
  const bool failing = sync_fails();
  for (const auto& [name, inode] : tree_) {
    if (failing) inode->lost = inode->lost || inode->synced != inode->bytes.size();
    else if (!dying() || random_.below(2) == 1) make_durable(*inode);
  }
  if (failing) return fail(Errc::kIo, "file '': syncing all failed: the disk reports an error");
  for (std::size_t k = 0; k < unsynced_.size();) {
    if (!dying() || random_.below(2) == 1) make_last(k);
    else ++k;
  }
  if (dying()) return fail(no_power(""));
  return {};
}

void SimDisk::close(FileHandle file) { handles_.erase(file); }

Result<std::vector<std::uint8_t>> SimDisk::read(const std::string& name, std::uint64_t limit_bytes) {
  NODAL_TRY_ASSIGN(const auto length, size(name));
  if (length > limit_bytes) {
    return fail(Errc::kTooLarge,
                fmt::format("file '{}': is {} bytes, over the limit of {}", name, length, limit_bytes));
  }
  NODAL_TRY(begin_read(name, length));
  return tree_.at(name)->bytes;
}

Result<std::uint64_t> SimDisk::size(const std::string& name) {
  NODAL_TRY(answers(name));
  if (!is_file_name(name)) return fail(bad_name(name));
  NODAL_TRY(check_no_link(name));
  const auto found = tree_.find(name);
  if (found == tree_.end()) return fail(not_there(name));
  if (found->second->folder) return fail(Errc::kIo, "file '" + name + "': is a folder");
  return found->second->bytes.size();
}

std::size_t SimDisk::memory() const {
  std::set<const Inode*> all;  // removed files, too, while a power failure could bring them back
  for (const Tree* tree : {&tree_, &lasting_})
    for (const auto& [name, inode] : *tree) all.insert(inode.get());
  for (const Change& change : unsynced_)
    for (const auto& [name, inode] : change.entries) all.insert(inode.get());
  std::size_t sum = 0;
  for (const Inode* inode : all) sum += inode ? inode->bytes.capacity() : 0;
  return sum;
}

std::uint64_t SimDisk::used() const {
  std::uint64_t sum = 0;
  for (const auto& [name, inode] : tree_) sum += inode->bytes.size();
  return sum;
}

}  // namespace nodal::hal::sim
