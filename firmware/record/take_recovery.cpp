#include "firmware/record/take_recovery.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "firmware/record/recovery.h"
#include "firmware/storage/durable_file.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {
namespace {

constexpr std::uint64_t kMaxNoteBytes = 1024;  // size limit of the files kRecoveringFile and kSetAsideFile
constexpr std::uint8_t kNothingRecorded = 0, kTakeRecovered = 1;

std::string path(std::uint64_t take, const std::string& file) { return take::take_folder(take) + "/" + file; }

/// Whether an error is the disk's, so that it says nothing about the take.
bool is_of_disk(Errc code) {
  return code == Errc::kIo || code == Errc::kDiskFull || code == Errc::kDeviceGone || code == Errc::kNotReady;
}

}  // namespace

Result<std::vector<std::uint8_t>> recovery_work(hal::DiskPort& disk, const std::string& folder,
                                                const std::function<void()>& progress) {
  const auto nothing = nothing_recorded(disk, folder);
  if (nothing && *nothing) return std::vector<std::uint8_t>{kNothingRecorded};
  NODAL_TRY(recover_take(disk, folder, progress));
  return std::vector<std::uint8_t>{kTakeRecovered};
}

std::optional<TakeRecovery::Done> TakeRecovery::step(bool begin_next) {
  if (running_) {
    const auto result = confined_->take_result();
    if (!result) return std::nullopt;
    return finish(*std::exchange(running_, std::nullopt), *result);
  }
  if (waiting_.empty() || !begin_next) return std::nullopt;
  return begin(waiting_.back());
}

std::optional<TakeRecovery::Done> TakeRecovery::recover(std::uint64_t take) {
  if (running_) return std::nullopt;
  return begin(take);
}

/// Notes the attempt before it begins: a take that ends nodald, or the board, counts as failed.
std::optional<TakeRecovery::Done> TakeRecovery::begin(std::uint64_t take) {
  forget(take);
  const Running run{take, attempts_of(take)};
  if (run.attempts >= kMaxAttempts)
    return set_aside(take, fmt::format("its recovery was begun {} times and did not end", run.attempts));
  note_attempts(take, run.attempts + 1);
  const std::string folder = take::take_folder(take);
  if (!confined_) return finish(run, recovery_work(disk_, folder, {}));
  if (const Status begun = confined_->begin({folder}); !begun) return finish(run, fail(begun.error()));
  running_ = run;
  return std::nullopt;
}

TakeRecovery::Done TakeRecovery::finish(const Running& run, const Result<std::vector<std::uint8_t>>& result) {
  if (result) {
    note_attempts(run.take, 0);
    const bool nothing = result->size() == 1 && result->front() == kNothingRecorded;
    return {run.take, nothing ? Outcome::kNothing : Outcome::kRecovered};
  }
  const Error& error = result.error();
  if (is_of_disk(error.code) || error.code == Errc::kBusy) note_attempts(run.take, run.attempts);
  else if (run.attempts + 1 >= kMaxAttempts) return set_aside(run.take, error.message);
  return {run.take, Outcome::kFailed, error.message};
}

TakeRecovery::Done TakeRecovery::set_aside(std::uint64_t take, const std::string& why) {
  const std::string reason = printable(why, 512);
  // Where the disk takes no more files, the take is tried again at the next start, beside the rig as now.
  (void)write_durably(disk_, take::take_folder(take), path(take, take::kSetAsideFile), reason + "\n");
  return {take, Outcome::kSetAside, reason};
}

int TakeRecovery::attempts_of(std::uint64_t take) const {
  const auto bytes = disk_.read(path(take, take::kRecoveringFile), kMaxNoteBytes);
  int attempts = 0;
  if (bytes) {
    const char* const text = reinterpret_cast<const char*>(bytes->data());
    std::from_chars(text, text + bytes->size(), attempts);
  }
  return std::clamp(attempts, 0, kMaxAttempts);
}

/// Without an effect on a disk that takes no more files.
void TakeRecovery::note_attempts(std::uint64_t take, int attempts) {
  const std::string folder = take::take_folder(take), file = path(take, take::kRecoveringFile);
  if (attempts != 0) {
    (void)write_durably(disk_, folder, file, fmt::format("{}\n", attempts));
  } else if (disk_.remove(file)) {
    (void)disk_.sync_folder(folder);
  }
}

void TakeRecovery::close() {
  if (!running_) return;
  confined_->end();
  const Running run = *std::exchange(running_, std::nullopt);
  note_attempts(run.take, run.attempts);
}

std::optional<std::string> set_aside_reason(hal::DiskPort& disk, std::uint64_t take) {
  const std::string file = path(take, take::kSetAsideFile);
  if (!disk.size(file)) return std::nullopt;
  const auto bytes = disk.read(file, kMaxNoteBytes);
  if (!bytes) return bytes.error().message;
  const std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  return printable(text.substr(0, text.find('\n')), 512);
}

}  // namespace nodal::firmware
