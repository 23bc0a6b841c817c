// The takes on the disk: their list, numbers, recovery, protection and deletion, and the room that a loop makes.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/record/take_entry.h"
#include "firmware/record/take_numbers.h"
#include "firmware/record/take_recovery.h"
#include "firmware/record/takes_in_use.h"
#include "hal/confined.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"

namespace nodal::firmware {

class TakeWriter;

/// The disk is claimed only while it is changed, and may be exchanged in between. So the list is read from the disk
/// again before each change and each answer. Files that this program did not make are never written over: a new take's
/// number must be free in memory, in kNextTakeFile and on the disk, and a folder that exists is never used for it.
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
      : disk_(disk), loop_(loop), numbers_(disk), recovery_(disk, confined) {}

  // --- The disk.
  Result<Hold> hold();
  /// Checks whether the disk was inserted, removed or exchanged. True if it was, and at the first call.
  bool watch();
  /// Why nothing could be recorded on the disk when it was last checked; empty: it is usable.
  const std::string& problem() const { return problem_.empty() ? contested_ : problem_; }
  /// Number of disks that have come since nodald started.
  std::uint64_t disks() const { return disks_; }
  bool here() const { return identity_.has_value(); }
  /// Syncs the disk and stops using it, until another one comes or use_again() is called. No hold may exist. Errors:
  /// kBusy while a file is being read; no further file is read from then on, so a later call succeeds.
  Status eject();
  void use_again();
  bool ejected() const { return ejected_.has_value(); }
  TakesInUse& in_use() { return in_use_; }

  // --- The list.
  /// Reads the takes that have changed on the disk.
  Status refresh();
  const std::map<std::uint64_t, TakeEntry>& takes() const { return takes_; }
  bool is_full() const { return takes_.size() >= kMaxTakes; }
  /// Whether a take may begin by itself: interrupted takes have been recovered, or another process is recovering them.
  bool ready() const { return here() && half_deleted_.empty() && (recovers_beside() || recovery_.idle()); }
  bool recovers_beside() const { return recovery_.is_beside(); }
  /// Recovers takes one after the other, and removes files that an interrupted deletion or test of the disk left.
  /// `begin`: the stage is idle, so another recovery may begin. True when it did something.
  bool recover_some(Instant now, bool begin);
  /// Returns, once, a sentence about a take that could not be recovered; empty: there is none.
  std::string take_problem() { return std::exchange(set_aside_, {}); }
  /// Cancels a running recovery, because nodald ends.
  void close();
  /// `manifest`: if set, only a take with this manifest is deleted.
  Status remove(std::uint64_t take, const std::optional<Sha256>& manifest = std::nullopt);
  Status protect(std::uint64_t take, bool on);

  // --- The take that is being recorded. The caller has a hold from the first to the last of these calls.
  /// A number that no take has had. It is stored before it is used, so that it is never used again.
  Result<std::uint64_t> new_number() { return numbers_.new_number(); }
  void begin(TakeEntry entry);
  /// Errors: the disk is no longer there, or another one is, or the take's folder was removed.
  Status check_recording(std::uint64_t take);
  void finish(std::uint64_t take, const Result<take::Manifest>& manifest);

  // --- Room.
  /// Returns the free bytes. In a loop, first deletes the oldest segments until `wanted` bytes are free. Deletes
  /// nothing if less than `least` would be free even after everything deletable is gone. `writing`: the take that is
  /// being recorded, or null.
  Result<std::uint64_t> make_room(std::uint64_t wanted, std::uint64_t least, TakeWriter* writing);
  /// The take to delete so that the full list has a place for another one, in a loop: the oldest one of which all may
  /// be deleted. Errors: kTooLarge if there is none.
  Result<std::uint64_t> oldest_to_go();
  std::uint64_t deleted_segments() const { return deleted_segments_; }

  static constexpr std::size_t kMaxTakes = 1000;
  /// Size limit of TakeEntry::problem, which may quote a text from the disk.
  static constexpr std::size_t kMaxProblemBytes = 512;
  /// Bytes of documents that one refresh() reads; further takes wait for the next one. At least one take is read.
  static constexpr std::uint64_t kMaxBytesAStep = std::uint64_t{32} << 20;
  static constexpr std::uint64_t kMaxTakeNumber = TakeNumbers::kMax;
  static constexpr Duration kTryAgainAfter = Duration::seconds(1);

 private:
  void forget();
  void lose(const Error& why);
  void follow(const std::vector<hal::FolderEntry>& entries, bool fresh);
  void load(std::uint64_t number, const hal::FolderEntry& folder, bool fresh);
  void leave_unread(std::uint64_t number, const hal::FolderEntry& folder, bool fresh);
  void load_unfinished(TakeEntry& entry, const std::optional<TakeEntry>& before, bool half_deleted, bool fresh);
  bool has_work() const { return !recovery_.idle() || !half_deleted_.empty() || leftover_; }
  bool note(const TakeRecovery::Done& done);
  bool remove_rest(std::uint64_t take);
  Result<TakeEntry*> finished(std::uint64_t take);
  bool recover(TakeEntry& entry);
  bool may_go(TakeEntry& entry);
  Result<std::uint64_t> deletable(std::uint64_t enough, const TakeWriter* writing);
  Result<std::optional<std::uint64_t>> delete_oldest(TakeWriter* writing);

  hal::DiskPort& disk_;
  const bool loop_;
  TakesInUse in_use_;
  std::size_t holds_ = 0;
  bool looked_ = false;                    ///< the disk has been read
  std::optional<std::uint64_t> identity_;  ///< identity of the disk that the list describes; empty: no disk is present
  /// The disk is left alone until another comes, or the same one again.
  struct Ejected {
    std::optional<std::uint64_t> disk;  ///< its identity, until it is removed
  };
  std::optional<Ejected> ejected_;
  std::uint64_t disks_ = 0;
  std::string problem_;
  std::string contested_;  ///< why recovery waits: another nodald has claimed the disk; empty: it does not
  std::map<std::uint64_t, TakeEntry> takes_;
  std::map<std::uint64_t, bool> unread_;  ///< takes that later steps read; true: they were on the disk when it came
  TakeNumbers numbers_;
  TakeRecovery recovery_;
  std::optional<Hold> recovering_;  ///< claims the disk while takes are recovered
  std::vector<std::uint64_t> half_deleted_;
  std::string set_aside_;
  bool leftover_ = false;  ///< a file of an interrupted test of the disk must be deleted
  Instant try_again_at_;
  std::uint64_t deleted_segments_ = 0;
};

}  // namespace nodal::firmware
