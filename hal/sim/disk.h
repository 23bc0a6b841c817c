// A disk in memory that loses what a real one may lose when the power goes.
#pragma once

#include <map>
#include <memory>
#include <set>

#include "hal/disk.h"
#include "hal/sim/clock.h"
#include "hal/sim/scene/random.h"

namespace nodal::hal::sim {

/// What a program writes is seen by the program at once, and lasts only as far as sync() and sync_folder() made it.
/// After a power loss any subset of the changes since then may be there: entries created, renamed or removed or
/// not, bytes there, missing, zero or garbage. A rename is whole or not at all.
///
/// Threading: thread-bound to its stage.
/// Ownership: as DiskPort.
/// Errors: as DiskPort; after the power went, kIo for everything.
class SimDisk final : public DiskPort {
 public:
  explicit SimDisk(std::uint64_t seed = 1, std::uint64_t capacity_bytes = std::uint64_t{1} << 40);
  ~SimDisk() override;

  // What the daemon sees.
  Result<FileHandle> create(const std::string& name) override;
  Result<FileHandle> open_append(const std::string& name) override;
  Result<FileHandle> open_read(const std::string& name) override;
  Result<std::size_t> read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) override;
  Status write(FileHandle file, std::span<const std::uint8_t> bytes) override;
  Status sync(FileHandle file) override;
  void close(FileHandle file) override;
  Result<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t limit_bytes) override;
  Result<std::uint64_t> size(const std::string& name) override;
  Status rename(const std::string& from, const std::string& to) override;
  Status remove(const std::string& name) override;
  Status make_folder(const std::string& name) override;
  Status sync_folder(const std::string& name) override;
  Result<std::vector<std::string>> list(const std::string& folder) override;
  Result<std::uint64_t> free_bytes() override;

  // What the test does.
  /// Operations that change the disk, counted from 0: every call of create, open_append, write, sync, rename,
  /// remove, make_folder and sync_folder.
  std::uint64_t operations() const { return operations_; }
  /// The power goes in the middle of operation k: it may have happened, not or in part, and fails with kIo, as
  /// everything after it.
  void die_at(std::uint64_t operation) { die_at_ = operation; }
  bool dead() const { return dead_; }
  /// The disk as it is found when the power is back. Which of the possible states is drawn from the seed.
  std::unique_ptr<SimDisk> after_power_loss(std::uint64_t seed) const;
  /// The disk as it is found when only the program was killed: everything it wrote is there.
  std::unique_ptr<SimDisk> after_kill() const;
  void set_capacity(std::uint64_t bytes) { capacity_ = bytes; }
  /// Operation k, and only it, fails with kIo and changes nothing.
  void fail_at(std::uint64_t operation) { fail_at_.insert(operation); }
  /// Every changing operation takes this long on `clock`, which is virtual.
  void be_slow(SimClock* clock, Duration each) {
    slow_clock_ = clock;
    slow_by_ = each;
  }

 private:
  struct Inode;
  using InodePtr = std::shared_ptr<Inode>;
  using Tree = std::map<std::string, InodePtr>;  ///< by whole name; the root is ""
  /// One change of entries that is whole or not at all: names and what they then stand for (null: nothing).
  struct Change {
    std::vector<std::pair<std::string, InodePtr>> entries;
  };
  struct Handle {
    InodePtr inode;
    std::string name;
    bool to_read = false;  ///< else to append
  };

  Status begin(const char* what, const std::string& name);
  Status check_parent(const std::string& name) const;
  Result<FileHandle> hand_out(InodePtr inode, const std::string& name, bool to_read = false);
  Result<Handle*> handle_of(FileHandle file, bool to_read);
  void commit(Change change);
  void make_last(std::size_t change);
  std::uint64_t used() const;
  static InodePtr survivor(const Inode& inode, Random& random);

  Random random_;
  std::uint64_t capacity_;
  Tree tree_;                     ///< as the program sees it
  Tree lasting_;                  ///< as far as synced
  std::vector<Change> unsynced_;  ///< in order; lasting_ and these give tree_
  std::map<FileHandle, Handle> handles_;
  FileHandle next_handle_ = 1;
  std::uint64_t operations_ = 0;
  std::uint64_t die_at_ = ~std::uint64_t{0};
  bool dying_ = false;  ///< this operation is the one
  bool dead_ = false;
  std::set<std::uint64_t> fail_at_;
  SimClock* slow_clock_ = nullptr;
  Duration slow_by_;
};

}  // namespace nodal::hal::sim
