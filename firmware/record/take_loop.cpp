// The part of TakeShelf that makes room on a full disk ([takes] when_full = "loop").
#include <fmt/format.h>

#include "firmware/record/loop.h"
#include "firmware/record/take_shelf.h"
#include "firmware/record/take_writer.h"
#include "protocol/base/try.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {

Result<std::uint64_t> TakeShelf::make_room(std::uint64_t wanted, std::uint64_t least, TakeWriter* writing) {
  const auto free = disk_.free_bytes();
  if (!free || !loop_ || *free >= wanted) return free;
  if (!unread_.empty()) (void)refresh();  // some of them may go
  NODAL_TRY_ASSIGN(const auto more, deletable(wanted - *free, writing));
  if (*free + more < least) return free;
  // Counted by the lengths of the files: a file system may tell later that they are free.
  for (std::uint64_t freed = 0; *free + freed < wanted;) {
    NODAL_TRY_ASSIGN(const auto deleted, delete_oldest(writing));
    if (!deleted) break;
    freed += *deleted;
  }
  return disk_.free_bytes();
}

/// Whether segments of the take may be deleted, as far as its entry says. A take that was not finished is recovered for
/// that. One that cannot be read stays, for people to look at.
bool TakeShelf::may_go(TakeEntry& entry) {
  if (entry.is_protected || entry.all_near_marks || in_use_.contains(entry.number)) return false;
  return entry.state == TakeState::kComplete && entry.ended != "still";
}

/// Bytes that may be deleted; it counts no further than `enough`.
Result<std::uint64_t> TakeShelf::deletable(std::uint64_t enough, const TakeWriter* writing) {
  std::uint64_t bytes = 0;
  for (auto next = takes_.begin(); next != takes_.end() && bytes < enough;) {
    auto& [number, entry] = *next++;
    const bool waits = recovery_.waits(number) || std::ranges::count(half_deleted_, number) > 0;
    if (waits && !recover(entry)) continue;
    if (!may_go(entry)) continue;
    const auto room = room_in_take(disk_, take::take_folder(number));
    if (!room) {
      const Errc code = room.error().code;
      if (code == Errc::kDeviceGone || code == Errc::kDiskFull) return fail(room.error());
      entry.set_damaged(room.error());
      continue;
    }
    entry.all_near_marks = room->bytes == 0 && entry.sets != 0;
    bytes += room->bytes;
  }
  return bytes + (writing ? writing->deletable_bytes() : 0);
}

Result<std::uint64_t> TakeShelf::oldest_to_go() {
  for (auto& [number, entry] : takes_) {
    if (!loop_ || !may_go(entry)) continue;
    const auto room = room_in_take(disk_, take::take_folder(number));
    if (room && room->all) return number;
  }
  return fail(
      Errc::kTooLarge,
      fmt::format("the disk has {} takes, the most that there may be{}; delete some: nodal take delete", takes_.size(),
                  loop_ ? ", and each is protected, has a mark, is being copied, is a still or cannot be read" : ""));
}

/// Deletes one segment, of the oldest take that has one which may be deleted, and returns its bytes; nothing if there
/// is none. A take without segments goes altogether.
Result<std::optional<std::uint64_t>> TakeShelf::delete_oldest(TakeWriter* writing) {
  for (auto next = takes_.begin(); next != takes_.end();) {
    auto& [number, entry] = *next++;
    if (!may_go(entry)) continue;
    auto trimmed = trim_take(disk_, take::take_folder(number));
    if (!trimmed) {
      const Errc code = trimmed.error().code;
      if (code == Errc::kDeviceGone || code == Errc::kDiskFull) return fail(trimmed.error());
      entry.set_damaged(trimmed.error());
      continue;
    }
    entry.all_near_marks = !*trimmed && entry.sets != 0;
    if (entry.all_near_marks) continue;
    if (*trimmed) {
      entry.complete((*trimmed)->manifest);
      ++deleted_segments_;
    }
    const std::uint64_t bytes = *trimmed ? (*trimmed)->bytes : 0;
    if (entry.sets == 0) {
      NODAL_TRY(remove(number));
    }
    return std::optional(bytes);
  }
  if (!writing) return std::optional<std::uint64_t>();
  auto deleted = writing->delete_oldest();
  if (deleted && *deleted) ++deleted_segments_;
  return deleted;
}

}  // namespace nodal::firmware
