// The takes on the disk: which there are, their numbers, recovery, protection, deletion, and the room that a loop
// makes.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/record/take_entry.h"
#include "firmware/record/take_recovery.h"
#include "firmware/record/takes_in_use.h"
#include "hal/confined.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"

namespace nodal::firmware {

class TakeWriter;

/// The disk is a guest: it is claimed only for as long as something of it changes, and may be another one each time.
/// The list is that of the disk: it is read again before each change and each answer. What this program did not make it
/// never writes over: a take's number is free in memory, in kNextTakeFile and on the disk, and its folder is made by
/// this program or not used.
///
/// Threading: thread-bound to the takes' stage, which blocks on the disk. in_use() is for control and the reader of
/// takes.
/// Ownership: the disk outlives it.
/// Errors: the disk's. kBusy, "another nodald uses the takes folder": while another program has claimed it.
class TakeShelf {
 public:
  /// The disk stays claimed while one exists.
  class Hold {
   public:
    explicit Hold(TakeShelf& shelf) : shelf_(&shelf) { ++shelf.holds_; }
    Hold(Hold&& other) noexcept : shelf_(std::exchange(other.shelf_, nullptr)) {}
    Hold& operator=(Hold&& other) noexcept {
      std::swap(shelf_, other.shelf_);
      return *this;
    }
    ~Hold() {
      if (shelf_ && --shelf_->holds_ == 0) shelf_->disk_.release();
    }

   private:
    TakeShelf* shelf_;
  };

  /// `loop`: [takes] when_full = "loop".
  /// `confined`: where takes are recovered; null: in recover_some().
  TakeShelf(hal::DiskPort& disk, bool loop, hal::ConfinedPort* confined)
      : disk_(disk), loop_(loop), recovery_(disk, confined) {}

  // --- The disk.
  Result<Hold> hold();
  /// Notices a disk that came or went. True if one did, or if it is the first call.
  bool watch();
  /// Why nothing can be recorded on the disk now; empty: it is there. Of the newest look at it.
  const std::string& problem() const { return problem_.empty() ? contested_ : problem_; }
  /// How many disks have been noticed.
  std::uint64_t disks() const { return disks_; }
  bool here() const { return identity_.has_value(); }
  /// Syncs the disk, and leaves it alone until there is another one, or use_again(). No hold may exist. kBusy while a
  /// file is being read: no other one is read from then on, so a later call succeeds.
  Status eject();
  void use_again();
  bool ejected() const { return ejected_; }
  TakesInUse& in_use() { return in_use_; }

  // --- The list.
  /// Reads what has changed on the disk.
  Status refresh();
  const std::map<std::uint64_t, TakeEntry>& takes() const { return takes_; }
  bool is_full() const { return takes_.size() >= kMaxTakes; }
  /// A take may begin by itself: those that ended without being finished are finished, or are being finished beside the
  /// stage.
  bool ready() const { return here() && half_deleted_.empty() && (recovers_beside() || recovery_.idle()); }
  bool recovers_beside() const { return recovery_.is_beside(); }
  /// Recovers takes one after the other, and removes what an interrupted deletion or test of the disk left. `begin`:
  /// there is nothing else to do. True when it did something.
  bool recover_some(Instant now, bool begin);
  /// What people must know of a take that was not recovered, once; empty: nothing.
  std::string take_problem() { return std::exchange(set_aside_, {}); }
  /// nodald ends: a running recovery is broken off.
  void close();
  /// `manifest`: if set, only a take with this manifest is deleted.
  Status remove(std::uint64_t take, const std::optional<Sha256>& manifest = std::nullopt);
  Status protect(std::uint64_t take, bool on);

  // --- The take that is being recorded. The caller has a hold from the first to the last of these.
  /// A number that no take has had. It is stored before it is used, so that it is never used again.
  Result<std::uint64_t> new_number();
  void begin(TakeEntry entry);
  /// Errors: the disk is no longer there, or another one is, or the take's folder was removed.
  Status check_recording(std::uint64_t take);
  void finish(std::uint64_t take, const Result<take::Manifest>& manifest);

  // --- Room.
  /// Returns the free bytes. In a loop, the oldest segments are deleted until `wanted` bytes are free. If all that may
  /// be deleted does not make at least `least` free, nothing is deleted. `writing`: the take that is being recorded, or
  /// null.
  Result<std::uint64_t> make_room(std::uint64_t wanted, std::uint64_t least, TakeWriter* writing);
  /// Whether a place in the full list can be made: in a loop, by deleting the oldest take of which all may be deleted.
  Result<std::uint64_t> oldest_to_go();
  std::uint64_t deleted_segments() const { return deleted_segments_; }

  static constexpr std::size_t kMaxTakes = 1000;
  /// Size limit of TakeEntry::problem, which may quote a text from the disk.
  static constexpr std::size_t kMaxProblemBytes = 512;
  /// Bytes of documents that one refresh() reads; further takes wait for the next one. At least one take is read.
  static constexpr std::uint64_t kMaxBytesAStep = std::uint64_t{32} << 20;
  static constexpr std::uint64_t kMaxTakeNumber = std::uint64_t{1} << 40;
  static constexpr Duration kTryAgainAfter = Duration::seconds(1);

 private:
  void forget();
  void lose(const Error& why);
  void follow(const std::vector<hal::FolderEntry>& entries, bool fresh);
  void load(std::uint64_t number, const hal::FolderEntry& folder, bool fresh);
  void leave_unread(std::uint64_t number, const hal::FolderEntry& folder, bool fresh);
  std::uint64_t document_bytes(const std::string& folder);
  void load_unfinished(TakeEntry& entry, const std::optional<TakeEntry>& before, bool half_deleted, bool fresh);
  bool has_work() const { return !recovery_.idle() || !half_deleted_.empty() || leftover_; }
  bool note(const TakeRecovery::Done& done);
  bool remove_rest(std::uint64_t take);
  void read_counter();
  Result<TakeEntry*> finished(std::uint64_t take);
  bool recover(TakeEntry& entry);
  bool being_deleted(std::uint64_t take);
  Status empty_folder(std::uint64_t take);
  bool may_go(TakeEntry& entry);
  Result<std::uint64_t> deletable(std::uint64_t enough, const TakeWriter* writing);
  Result<std::optional<std::uint64_t>> delete_oldest(TakeWriter* writing);
  void set_damaged(TakeEntry& entry, const Error& why);

  hal::DiskPort& disk_;
  const bool loop_;
  TakesInUse in_use_;
  std::size_t holds_ = 0;
  bool looked_ = false;                    ///< the disk has been read
  std::optional<std::uint64_t> identity_;  ///< identity of the disk that the list describes; empty: no disk is present
  bool ejected_ = false;                   ///< the disk is left alone until another comes, or the same one again
  std::optional<std::uint64_t> ejected_disk_;  ///< its identity, until it is removed
  std::uint64_t disks_ = 0;
  std::string problem_;
  std::string contested_;  ///< takes wait for their recovery, and another nodald has claimed the disk
  Status counter_read_;    ///< kNextTakeFile
  std::map<std::uint64_t, TakeEntry> takes_;
  std::map<std::uint64_t, bool> unread_;  ///< takes that later steps read; true: they were there with the disk
  std::uint64_t highest_ = 0;             ///< number on the disk, also of takes that are not listed
  std::uint64_t next_take_ = 1;
  TakeRecovery recovery_;
  std::optional<Hold> recovering_;  ///< while takes are recovered
  std::vector<std::uint64_t> half_deleted_;
  std::string set_aside_;
  bool leftover_ = false;  ///< a file of an interrupted test of the disk must be deleted
  Instant try_again_at_;
  std::uint64_t deleted_segments_ = 0;
};

/// In the root of the takes' disk: the number of the next take, so that numbers are never used again.
inline const std::string kNextTakeFile = "next-take";

}  // namespace nodal::firmware
