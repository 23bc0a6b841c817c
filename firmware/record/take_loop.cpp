// The part of TakeKeeper that makes room on a full disk ([takes] when_full = "loop").
#include "firmware/record/loop.h"
#include "firmware/record/take_keeper.h"
#include "firmware/record/take_writer.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {

/// Asks how much is free. In a loop, deletes the oldest segments until `needed` bytes are, or nothing more may be deleted.
Status TakeKeeper::make_room(std::uint64_t needed) {
  const auto free = disk_.free_bytes();
  if (!free) return fail(free.error());
  report_.free_bytes = *free;
  if (!config_.takes->loop || *free >= needed) return {};
  // Counted by the lengths of the files: a file system may tell later that they are free.
  for (std::uint64_t freed = 0; *free + freed < needed;) {
    const auto deleted = delete_oldest();
    if (!deleted) return fail(deleted.error());
    if (!*deleted) break;
    freed += **deleted;
  }
  const auto now_free = disk_.free_bytes();
  if (!now_free) return fail(now_free.error());
  report_.free_bytes = *now_free;
  return {};
}

/// Deletes one segment, of the oldest take that has one which may be deleted, and returns its bytes; nothing if there is none. A
/// take without segments goes altogether. A take that cannot be read stays, for people to look at.
Result<std::optional<std::uint64_t>> TakeKeeper::delete_oldest() {
  for (auto next = takes_.begin(); next != takes_.end();) {
    auto& [number, entry] = *next++;
    if (entry.is_protected || entry.all_near_marks) continue;
    if (entry.state == TakeState::kUnfinished && !recover(entry)) continue;
    if (entry.state != TakeState::kComplete || entry.ended == "still") continue;
    auto trimmed = trim_take(disk_, take::take_folder(number));
    if (!trimmed) {
      const Errc code = trimmed.error().code;
      if (code == Errc::kDeviceGone || code == Errc::kDiskFull) return fail(trimmed.error());
      entry.state = TakeState::kDamaged;
      entry.problem = trimmed.error().message;
      continue;
    }
    entry.all_near_marks = !*trimmed && entry.sets != 0;
    if (entry.all_near_marks) continue;
    if (*trimmed) {
      entry.complete((*trimmed)->manifest);
      ++report_.deleted_segments;
    }
    const std::uint64_t bytes = *trimmed ? (*trimmed)->bytes : 0;
    if (entry.sets == 0) {
      if (const Status removed = remove({number}); !removed) return fail(removed.error());
    }
    return std::optional(bytes);
  }
  if (!writing_) return std::optional<std::uint64_t>();
  auto deleted = writing_->delete_oldest();
  if (deleted && *deleted) ++report_.deleted_segments;
  return deleted;
}

}  // namespace nodal::firmware
