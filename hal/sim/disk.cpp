#include "hal/sim/disk.h"

#include <algorithm>

namespace nodal::hal::sim {

/// The object that a name refers to: a folder, or a file's bytes, of which the first `synced` are durable.
struct SimDisk::Inode {
  bool folder = false;
  std::vector<std::uint8_t> bytes;
  std::size_t synced = 0;
};

namespace {

constexpr std::size_t kSector = 512;

bool well_formed(const std::string& name) {
  if (name.empty() || name.front() == '/' || name.back() == '/' || name.find('\0') != std::string::npos) return false;
  std::size_t from = 0;
  while (from <= name.size()) {
    const std::size_t slash = std::min(name.find('/', from), name.size());
    const std::string part = name.substr(from, slash - from);
    if (part.empty() || part == "." || part == "..") return false;
    from = slash + 1;
  }
  return true;
}

std::string parent_of(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

bool inside(const std::string& name, const std::string& folder) {
  return name.size() > folder.size() && name.compare(0, folder.size(), folder) == 0 && name[folder.size()] == '/';
}

Error bad_name(const std::string& name) {
  return {Errc::kBadValue, "file '" + name + "': a name is parts with '/' between, never '..', '.' or empty ones"};
}
Error not_there(const std::string& name) { return {Errc::kNotFound, "file '" + name + "': is not there"}; }
Error no_power(const std::string& name) { return {Errc::kIo, "file '" + name + "': the disk lost its power"}; }

}  // namespace

SimDisk::SimDisk(std::uint64_t seed, std::uint64_t capacity_bytes) : random_(seed, "disk"), capacity_(capacity_bytes) {}
SimDisk::~SimDisk() = default;

/// Counts an operation that changes the disk, and applies the fault that a test has planned for it.
Status SimDisk::begin(const char* what, const std::string& name) {
  if (dead_) return fail(no_power(name));
  const std::uint64_t operation = operations_++;
  if (slow_clock_ != nullptr) slow_clock_->advance(slow_by_);
  dying_ = operation == die_at_;
  if (dying_) dead_ = true;
  if (fail_at_.count(operation) != 0) {
    return fail(Errc::kIo, "file '" + name + "': " + what + " failed: the disk reports an error");
  }
  return {};
}

Status SimDisk::check_parent(const std::string& name) const {
  if (!well_formed(name)) return fail(bad_name(name));
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
  if (dying_ && random_.below(2) == 0) return;
  for (const auto& [name, inode] : change.entries) {
    if (inode) {
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
  if (found == handles_.end()) return fail(Errc::kWrongState, "file handle " + std::to_string(file) + ": is not open");
  if (found->second.to_read != to_read) {
    return fail(Errc::kWrongState, "file '" + found->second.name + "': is open to be " +
                                       (to_read ? "written" : "read") + ", not to be " +
                                       (to_read ? "read" : "written"));
  }
  return &found->second;
}

Result<FileHandle> SimDisk::create(const std::string& name) {
  if (auto begun = begin("creating it", name); !begun) return fail(begun.error());
  if (auto placed = check_parent(name); !placed) return fail(placed.error());
  const auto found = tree_.find(name);
  if (found != tree_.end() && found->second->folder) {
    return fail(Errc::kExists, "file '" + name + "': is a folder");
  }
  auto inode = std::make_shared<Inode>();
  commit({{{name, inode}}});
  if (dying_) return fail(no_power(name));
  return hand_out(std::move(inode), name);
}

Result<FileHandle> SimDisk::open_append(const std::string& name) {
  if (auto begun = begin("opening it", name); !begun) return fail(begun.error());
  if (!well_formed(name)) return fail(bad_name(name));
  const auto found = tree_.find(name);
  if (found == tree_.end()) return fail(not_there(name));
  if (found->second->folder) return fail(Errc::kIo, "file '" + name + "': is a folder");
  if (dying_) return fail(no_power(name));
  return hand_out(found->second, name);
}

Result<FileHandle> SimDisk::open_read(const std::string& name) {
  const auto length = size(name);
  if (!length) return fail(length.error());
  return hand_out(tree_.at(name), name, true);
}

Result<std::size_t> SimDisk::read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) {
  const auto handle = handle_of(file, true);
  if (!handle) return fail(handle.error());
  if (dead_) return fail(no_power((*handle)->name));
  const std::vector<std::uint8_t>& data = (*handle)->inode->bytes;
  if (offset >= data.size()) return 0;
  const std::size_t count = std::min<std::uint64_t>(bytes.size(), data.size() - offset);
  std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(offset), count, bytes.begin());
  return count;
}

Status SimDisk::write(FileHandle file, std::span<const std::uint8_t> bytes) {
  const auto handle = handle_of(file, false);
  if (!handle) return fail(handle.error());
  const std::string& name = (*handle)->name;
  if (auto begun = begin("writing it", name); !begun) return begun;
  std::vector<std::uint8_t>& data = (*handle)->inode->bytes;
  if (dying_) {
    const auto part = static_cast<std::ptrdiff_t>(random_.below(bytes.size() + 1));
    data.insert(data.end(), bytes.begin(), bytes.begin() + part);
    return fail(no_power(name));
  }
  const std::uint64_t in_use = used();
  const std::uint64_t room = capacity_ > in_use ? capacity_ - in_use : 0;
  const auto fits = static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(room, bytes.size()));
  data.insert(data.end(), bytes.begin(), bytes.begin() + fits);
  if (static_cast<std::size_t>(fits) < bytes.size()) {
    return fail(Errc::kDiskFull, "file '" + name + "': the disk is full; make room and try again");
  }
  return {};
}

Status SimDisk::sync(FileHandle file) {
  const auto found = handles_.find(file);
  if (found == handles_.end()) return fail(Errc::kWrongState, "file handle " + std::to_string(file) + ": is not open");
  if (auto begun = begin("syncing it", found->second.name); !begun) return begun;
  if (!dying_ || random_.below(2) == 1) found->second.inode->synced = found->second.inode->bytes.size();
  if (dying_) return fail(no_power(found->second.name));
  return {};
}

void SimDisk::close(FileHandle file) { handles_.erase(file); }

Result<std::vector<std::uint8_t>> SimDisk::read(const std::string& name, std::uint64_t limit_bytes) {
  const auto length = size(name);
  if (!length) return fail(length.error());
  if (*length > limit_bytes) {
    return fail(Errc::kTooLarge, "file '" + name + "': is " + std::to_string(*length) + " bytes, over the limit of " +
                                     std::to_string(limit_bytes));
  }
  return tree_.at(name)->bytes;
}

Result<std::uint64_t> SimDisk::size(const std::string& name) {
  if (dead_) return fail(no_power(name));
  if (!well_formed(name)) return fail(bad_name(name));
  const auto found = tree_.find(name);
  if (found == tree_.end()) return fail(not_there(name));
  if (found->second->folder) return fail(Errc::kIo, "file '" + name + "': is a folder");
  return found->second->bytes.size();
}

Status SimDisk::rename(const std::string& from, const std::string& to) {
  if (auto begun = begin("renaming it", from); !begun) return begun;
  if (!well_formed(from)) return fail(bad_name(from));
  if (auto placed = check_parent(to); !placed) return placed;
  const auto found = tree_.find(from);
  if (found == tree_.end()) return fail(not_there(from));
  const auto target = tree_.find(to);
  if (found->second->folder || (target != tree_.end() && target->second->folder)) {
    return fail(Errc::kUnsupported, "file '" + from + "': folders are not renamed or replaced");
  }
  if (from != to) commit({{{to, found->second}, {from, nullptr}}});
  if (dying_) return fail(no_power(from));
  return {};
}

Status SimDisk::remove(const std::string& name) {
  if (auto begun = begin("removing it", name); !begun) return begun;
  if (!well_formed(name)) return fail(bad_name(name));
  const auto found = tree_.find(name);
  if (found == tree_.end()) return fail(not_there(name));
  if (found->second->folder) {
    const auto next = std::next(found);
    // A folder's entries sort directly after it, except for names that continue with a character below '/'.
    const bool full = std::any_of(next, tree_.end(), [&](const auto& entry) { return inside(entry.first, name); });
    if (full) return fail(Errc::kExists, "file '" + name + "': is a folder with files in it");
  }
  commit({{{name, nullptr}}});
  if (dying_) return fail(no_power(name));
  return {};
}

Status SimDisk::make_folder(const std::string& name) {
  if (auto begun = begin("making it", name); !begun) return begun;
  if (auto placed = check_parent(name); !placed) return placed;
  const auto found = tree_.find(name);
  if (found != tree_.end()) {
    if (found->second->folder) return {};
    return fail(Errc::kExists, "file '" + name + "': is there and not a folder");
  }
  auto inode = std::make_shared<Inode>();
  inode->folder = true;
  commit({{{name, std::move(inode)}}});
  if (dying_) return fail(no_power(name));
  return {};
}

Status SimDisk::sync_folder(const std::string& name) {
  if (auto begun = begin("syncing it", name); !begun) return begun;
  if (!name.empty()) {
    if (!well_formed(name)) return fail(bad_name(name));
    const auto found = tree_.find(name);
    if (found == tree_.end()) return fail(not_there(name));
    if (!found->second->folder) return fail(Errc::kIo, "file '" + name + "': is not a folder");
  }
  for (std::size_t k = 0; k < unsynced_.size();) {
    const auto& entries = unsynced_[k].entries;
    const bool here =
        std::any_of(entries.begin(), entries.end(), [&](const auto& entry) { return parent_of(entry.first) == name; });
    if (here && (!dying_ || random_.below(2) == 1)) {
      make_last(k);
    } else {
      ++k;
    }
  }
  if (dying_) return fail(no_power(name));
  return {};
}

Result<std::vector<std::string>> SimDisk::list(const std::string& folder) {
  if (dead_) return fail(no_power(folder));
  if (!folder.empty()) {
    if (!well_formed(folder)) return fail(bad_name(folder));
    const auto found = tree_.find(folder);
    if (found == tree_.end()) return fail(not_there(folder));
    if (!found->second->folder) return fail(Errc::kIo, "file '" + folder + "': is not a folder");
  }
  std::vector<std::string> names;
  for (const auto& [name, inode] : tree_) {
    if (parent_of(name) == folder) names.push_back(name.substr(folder.empty() ? 0 : folder.size() + 1));
  }
  std::sort(names.begin(), names.end());
  return names;
}

Result<std::uint64_t> SimDisk::free_bytes() {
  if (dead_) return fail(no_power(""));
  const std::uint64_t in_use = used();
  return capacity_ > in_use ? capacity_ - in_use : 0;
}

std::uint64_t SimDisk::used() const {
  std::uint64_t sum = 0;
  for (const auto& [name, inode] : tree_) sum += inode->bytes.size();
  return sum;
}

/// An inode after the power loss: the synced bytes, and of the rest nothing, a part, or sectors that were never
/// written.
SimDisk::InodePtr SimDisk::survivor(const Inode& inode, Random& random) {
  auto left = std::make_shared<Inode>();
  left->folder = inode.folder;
  const std::size_t loose = inode.bytes.size() - inode.synced;
  const std::size_t kept = inode.synced + (random.below(4) == 0 ? loose : random.below(loose + 1));
  left->bytes.assign(inode.bytes.begin(), inode.bytes.begin() + static_cast<std::ptrdiff_t>(kept));
  const std::uint64_t fate = random.below(3);
  for (std::size_t sector = (inode.synced + kSector - 1) / kSector * kSector; fate != 0 && sector < kept;
       sector += kSector) {
    if (random.below(2) == 0) continue;
    for (std::size_t i = sector; i < std::min(sector + kSector, kept); ++i) {
      left->bytes[i] = fate == 1 ? std::uint8_t{0} : static_cast<std::uint8_t>(random.next());
    }
  }
  left->synced = left->bytes.size();
  return left;
}

std::unique_ptr<SimDisk> SimDisk::after_power_loss(std::uint64_t seed) const {
  Random random(seed, "power loss");
  SimDisk scratch(seed, capacity_);
  scratch.lasting_ = lasting_;
  scratch.unsynced_ = unsynced_;
  // Either all changes up to some moment are durable, as on a journal that commits in order, or any subset of them.
  const bool in_order = random.below(2) == 0;
  const std::uint64_t last = random.below(unsynced_.size() + 1);
  for (std::size_t k = 0, i = 0; i < unsynced_.size(); ++i) {
    if (in_order ? i < last : random.below(2) == 0) {
      scratch.make_last(k);
    } else {
      ++k;
    }
  }
  auto found = std::make_unique<SimDisk>(random.next(), capacity_);
  std::map<const Inode*, InodePtr> survivors;
  for (const auto& [name, inode] : scratch.lasting_) {
    // An entry is lost if its folder is; parents sort before their entries.
    const std::string parent = parent_of(name);
    if (!parent.empty() && found->tree_.count(parent) == 0) continue;
    InodePtr& left = survivors[inode.get()];
    if (!left) left = survivor(*inode, random);
    found->tree_[name] = left;
  }
  found->lasting_ = found->tree_;
  return found;
}

std::unique_ptr<SimDisk> SimDisk::after_kill() const {
  auto found = std::make_unique<SimDisk>(Random(operations_, "kill").next(), capacity_);
  std::map<const Inode*, InodePtr> copies;
  const auto copy = [&](const InodePtr& inode) {
    if (!inode) return InodePtr{};
    InodePtr& made = copies[inode.get()];
    if (!made) made = std::make_shared<Inode>(*inode);
    return made;
  };
  for (const auto& [name, inode] : tree_) found->tree_[name] = copy(inode);
  for (const auto& [name, inode] : lasting_) found->lasting_[name] = copy(inode);
  for (const Change& change : unsynced_) {
    Change same;
    for (const auto& [name, inode] : change.entries) same.entries.emplace_back(name, copy(inode));
    found->unsynced_.push_back(std::move(same));
  }
  return found;
}

}  // namespace nodal::hal::sim
