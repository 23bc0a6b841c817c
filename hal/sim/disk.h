// A disk in memory that loses what a real disk can lose in a power failure.
#pragma once

#include <map>
#include <memory>
#include <set>

#include "hal/disk.h"
#include "hal/sim/clock.h"
#include "hal/sim/scene/random.h"

namespace nodal::hal::sim {

/// The program sees its writes at once; only sync() and sync_folder() make them durable. After a power loss any subset
/// of the later changes may be present: entries created, renamed or removed or not; bytes present, missing, zero or
/// garbage. A rename is atomic.
///
/// Threading: thread-bound to its stage.
/// Ownership: as DiskPort.
/// Errors: as DiskPort; after the power loss, kIo for every call.
class SimDisk final : public DiskPort {
 public:
  explicit SimDisk(std::uint64_t seed = 1, std::uint64_t capacity_bytes = std::uint64_t{1} << 40);
  ~SimDisk() override;

  // What the daemon uses.
  Status claim() override { return claim_for(this); }
  void release() override { release_for(this); }
  Result<std::uint64_t> identity() override;
  Result<FileHandle> create(const std::string& name) override;
  Result<FileHandle> open_append(const std::string& name) override;
  Result<FileHandle> open_read(const std::string& name) override;
  Result<std::size_t> read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) override;
  Status write(FileHandle file, std::span<const std::uint8_t> bytes) override;
  Status write_pieces(FileHandle file, std::span<const std::span<const std::uint8_t>> pieces) override;
  Status overwrite(FileHandle file, std::uint64_t offset, std::span<const std::uint8_t> bytes) override;
  Status truncate(FileHandle file, std::uint64_t size) override;
  void start_write_out(FileHandle file) override;
  void preallocate(FileHandle file, std::uint64_t bytes) override;
  Status sync(FileHandle file) override;
  Status sync_all() override;
  void close(FileHandle file) override;
  Result<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t limit_bytes) override;
  Result<std::uint64_t> size(const std::string& name) override;
  Status rename(const std::string& from, const std::string& to) override;
  Status rename_new(const std::string& from, const std::string& to) override;
  Status remove(const std::string& name) override;
  Status make_folder(const std::string& name) override;
  Status sync_folder(const std::string& name) override;
  Result<std::vector<std::string>> list(const std::string& folder) override;
  Result<std::vector<FolderEntry>> entries(const std::string& folder) override;
  Result<std::uint64_t> free_bytes() override;
  Result<std::uint64_t> total_bytes() override;

  // What the test uses.
  /// The same for one of several ports on this disk, such as those of a SimCardSlot.
  Status claim_for(const void* port);
  void release_for(const void* port);
  bool claimed() const { return claimed_by_ != nullptr; }
  /// Puts a durable file there, also in the place of another one.
  void put(const std::string& name, std::span<const std::uint8_t> bytes);
  /// A symbolic link. Where it leads to is not kept, because nothing follows it.
  void put_link(const std::string& name);
  /// A second name for the same file: a hard link.
  void put_second_name(const std::string& file, const std::string& name);
  /// Number of operations that change the disk: every call of create, open_append, write, overwrite, truncate, sync,
  /// sync_all, rename, remove, make_folder and sync_folder.
  std::uint64_t operations() const { return operations_; }
  /// The power fails during operation k (counted from 0): it is done completely, partly or not at all, and it and all
  /// later operations fail with kIo.
  void die_at(std::uint64_t operation) { die_at_ = operation; }
  bool dead() const { return dead_; }
  /// Bytes of this process's memory that hold the files.
  std::size_t memory() const;
  /// The disk after the power loss; `seed` selects one of the possible states.
  std::unique_ptr<SimDisk> after_power_loss(std::uint64_t seed) const;
  /// The disk after only the program was killed: all its writes are present.
  std::unique_ptr<SimDisk> after_kill() const;
  void set_capacity(std::uint64_t bytes) { capacity_ = bytes; }
  /// Operation k fails with kIo and changes nothing; other operations are not affected.
  void fail_at(std::uint64_t operation) { fail_at_.insert(operation); }
  /// Every changing operation takes this long on `clock`, which must be virtual.
  void be_slow(SimClock* clock, Duration each) {
    slow_clock_ = clock;
    slow_by_ = each;
  }
  /// Writing takes this long on `clock`, which must be virtual.
  void set_speed(SimClock* clock, std::uint64_t bytes_per_second) {
    slow_clock_ = clock;
    speed_ = bytes_per_second;
  }
  /// The next changing operation takes so long on `clock`, which must be virtual.
  void stall(SimClock* clock, Duration once) {
    slow_clock_ = clock;
    stall_ = once;
  }
  /// The next calls of read() and read_at() fail with kIo.
  void fail_reads(int count) { failing_reads_ = count; }
  /// Bytes of the file from `offset` on cannot be read: kIo. Empty: all can.
  void spoil(const std::string& name, std::uint64_t offset) { spoiled_ = {name, offset}; }
  /// Every changing operation fails with kIo from now on, or no longer.
  void be_read_only(bool on = true) { read_only_ = on; }
  /// sync() and sync_all() succeed and make nothing durable.
  void lie_about_sync(bool lies) { lies_ = lies; }
  /// All calls fail with kDeviceGone from now on, or no longer.
  void unplug(bool gone = true) { gone_ = gone; }
  /// The next calls of sync() or sync_all() fail with kIo, and their bytes are lost: later ones do not make them
  /// durable.
  void fail_syncs(int count) { failing_syncs_ = count; }

 private:
  struct Inode;
  using InodePtr = std::shared_ptr<Inode>;
  using Tree = std::map<std::string, InodePtr>;  ///< by full name; the root is ""
  /// One atomic change of entries: names and the inodes they then refer to (null: removed).
  struct Change {
    std::vector<std::pair<std::string, InodePtr>> entries;
  };
  struct Handle {
    InodePtr inode;
    std::string name;
    bool to_read = false;  ///< opened for reading, else for appending
  };

  void make_durable(Inode& inode);
  Status begin(const char* what, const std::string& name);
  Status begin_read(const std::string& name, std::uint64_t end);
  Status check_parent(const std::string& name) const;
  Result<FileHandle> hand_out(InodePtr inode, const std::string& name, bool to_read = false);
  Result<Handle*> handle_of(FileHandle file, bool to_read);
  Status check_no_link(const std::string& name) const;
  Status rename_as(const std::string& from, const std::string& to, bool replaces);
  void commit(Change change);
  void make_last(std::size_t change);
  std::uint64_t used() const;
  static InodePtr survivor(const Inode& inode, Random& random);

  Random random_;
  const std::uint64_t identity_;
  const void* claimed_by_ = nullptr;
  std::uint64_t changes_ = 0;
  std::uint64_t capacity_;
  Tree tree_;                     ///< as seen by the program
  Tree lasting_;                  ///< as far as it is durable
  std::vector<Change> unsynced_;  ///< oldest first; applied to lasting_ they give tree_
  std::map<FileHandle, Handle> handles_;
  FileHandle next_handle_ = 1;
  std::uint64_t operations_ = 0;
  std::uint64_t die_at_ = ~std::uint64_t{0};
  bool dying_ = false;  ///< the power fails during the present operation
  bool dead_ = false;
  std::set<std::uint64_t> fail_at_;
  SimClock* slow_clock_ = nullptr;
  Duration slow_by_;
  std::uint64_t speed_ = 0;  ///< bytes a second; 0: no limit
  bool lies_ = false;
  bool gone_ = false;
  int failing_syncs_ = 0;
  int failing_reads_ = 0;
  std::pair<std::string, std::uint64_t> spoiled_;
  bool read_only_ = false;
  Duration stall_;
};

}  // namespace nodal::hal::sim
