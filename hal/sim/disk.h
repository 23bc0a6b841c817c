// A disk in memory that loses what a real disk can lose in a power failure.
#pragma once

#include <map>
#include <memory>

#include "hal/disk.h"
#include "hal/sim/disk_faults.h"
#include "hal/sim/scene/random.h"

namespace nodal::hal::sim {

/// The program sees its writes at once; only sync() and sync_folder() make them durable. After a power loss any subset
/// of the later changes may be present: entries created, renamed or removed or not; bytes present, missing, zero or
/// garbage. A rename is atomic.
///
/// Threading: thread-bound to its stage.
/// Ownership: as DiskPort.
/// Errors: as DiskPort; after the power loss, kIo for every call.
class SimDisk final : public DiskPort, public DiskFaults {
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

  // What the test uses, besides DiskFaults.
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
  /// Bytes of this process's memory that hold the files.
  std::size_t memory() const;
  /// The disk after the power loss; `seed` selects one of the possible states.
  std::unique_ptr<SimDisk> after_power_loss(std::uint64_t seed) const;
  /// The disk after only the program was killed: all its writes are present.
  std::unique_ptr<SimDisk> after_kill() const;
  void set_capacity(std::uint64_t bytes) { capacity_ = bytes; }

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
};

}  // namespace nodal::hal::sim
