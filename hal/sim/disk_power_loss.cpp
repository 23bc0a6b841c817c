// The part of SimDisk that says what a power failure leaves.
#include <algorithm>

#include "hal/sim/disk.h"
#include "hal/sim/disk_inode.h"

namespace nodal::hal::sim {

/// An inode after the power loss: the synced bytes, and of the rest nothing, a part, or sectors that were never
/// written.
SimDisk::InodePtr SimDisk::survivor(const Inode& inode, Random& random) {
  auto left = std::make_shared<Inode>();
  left->folder = inode.folder;
  left->link = inode.link;
  if (inode.before_cut && random.below(2) == 0) {
    left->bytes = *inode.before_cut;
    left->synced = left->bytes.size();
    return left;
  }
  const std::size_t loose = inode.bytes.size() - inode.synced;
  const std::size_t kept = inode.synced + (random.below(4) == 0 ? loose : random.below(loose + 1));
  left->bytes.assign(inode.bytes.begin(), inode.bytes.begin() + static_cast<std::ptrdiff_t>(kept));
  const std::uint64_t fate = random.below(3);
  for (std::size_t sector = (inode.synced + DiskPort::kSector - 1) / DiskPort::kSector * DiskPort::kSector;
       fate != 0 && sector < kept; sector += DiskPort::kSector) {
    if (random.below(2) == 0) continue;
    for (std::size_t i = sector; i < std::min<std::size_t>(sector + DiskPort::kSector, kept); ++i) {
      left->bytes[i] = fate == 1 ? std::uint8_t{0} : static_cast<std::uint8_t>(random.next());
    }
  }
  for (const auto& [at, bytes] : inode.replaced) {
    if (random.below(2) == 0 || at + bytes.size() > left->bytes.size()) continue;
    std::ranges::copy(bytes, left->bytes.begin() + static_cast<std::ptrdiff_t>(at));
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
  auto found = std::make_unique<SimDisk>(Random(operations(), "kill").next(), capacity_);
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
