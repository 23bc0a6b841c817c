#include "firmware/record/disk_test.h"

#include <fmt/format.h>

#include <algorithm>
#include <random>
#include <utility>

#include "protocol/base/try.h"

namespace nodal::firmware {
const std::string DiskTest::kFile = "disk-test";

std::uint64_t DiskSpeed::bytes_a_second() const {
  const auto milliseconds = static_cast<std::uint64_t>(std::max<std::int64_t>(1, took.ms()));
  return bytes / milliseconds * 1000;
}

DiskVerdict judge_disk(const DiskSpeed& speed, std::string_view mode, std::uint64_t needed,
                       std::uint64_t buffer_bytes) {
  DiskVerdict verdict{std::string(mode), needed, false, {}};
  const std::uint64_t got = speed.bytes_a_second();
  const auto megabytes = [](std::uint64_t bytes) { return static_cast<double>(bytes) / 1e6; };
  const double in_a_sync = static_cast<double>(needed) * static_cast<double>(speed.worst_sync.ns()) / 1e9;
  if (got < needed) {
    verdict.why = fmt::format("needs {:.1f} MB/s, and the disk takes {:.1f}", megabytes(needed), megabytes(got));
  } else if (got < needed + needed / 4) {
    verdict.why = fmt::format("needs {:.1f} MB/s, and the disk takes {:.1f}: less than a quarter more",
                              megabytes(needed), megabytes(got));
  } else if (in_a_sync > static_cast<double>(buffer_bytes)) {
    verdict.why =
        fmt::format("a sync took {:.1f} s, in which {:.0f} MB come in; [takes] buffer_mb holds {:.0f} MB",
                    static_cast<double>(speed.worst_sync.ns()) / 1e9, in_a_sync / 1e6, megabytes(buffer_bytes));
  } else {
    verdict.sustained = true;
    verdict.why = fmt::format("needs {:.1f} MB/s, and the disk takes {:.1f}", megabytes(needed), megabytes(got));
  }
  return verdict;
}

DiskTest::DiskTest(hal::DiskPort& disk, Duration length, std::uint64_t most_bytes, Instant now)
    : disk_(disk), length_(length), most_bytes_(most_bytes), start_(now), piece_(kPiece), synced_at_(now) {
  // Nothing that a file system or a card could compress.
  std::mt19937_64 random(1);
  for (std::uint8_t& byte : piece_) byte = static_cast<std::uint8_t>(random());
}

Result<std::unique_ptr<DiskTest>> DiskTest::begin(hal::DiskPort& disk, Duration length, Instant now) {
  NODAL_TRY_ASSIGN(const auto free, disk.free_bytes());
  if (free < kMinRoom) {
    return fail(Errc::kDiskFull,
                fmt::format("the disk of the takes has {} MB free, and the test needs {} MB; delete takes "
                            "(nodal take delete) or change the card",
                            free / 1'000'000, kMinRoom / 1'000'000));
  }
  std::unique_ptr<DiskTest> made(new DiskTest(disk, length, std::min(kMaxBytes, free / 2), now));
  remove_leftover(disk);
  NODAL_TRY_ASSIGN(const auto file, disk.create(kFile));
  made->file_ = file;
  return made;
}

DiskTest::~DiskTest() {
  disk_.close(file_);
  remove_leftover(disk_);
}

void DiskTest::remove_leftover(hal::DiskPort& disk) {
  if (disk.size(kFile)) (void)disk.remove(kFile);
}

Result<std::optional<DiskSpeed>> DiskTest::step(Instant now) {
  const bool enough = now - start_ >= length_ || written_ + kPiece > most_bytes_;
  if (syncing_since_) {
    speed_.worst_sync = std::max(speed_.worst_sync, now - *syncing_since_);
    speed_.bytes = written_;
    speed_.took = now - start_;
    syncing_since_.reset();
    synced_at_ = now;
    if (enough) return std::optional(speed_);
  }
  if (enough || now - synced_at_ >= kSyncEvery) {
    syncing_since_ = now;
    NODAL_TRY(disk_.sync_all());
    return std::optional<DiskSpeed>();
  }
  NODAL_TRY(disk_.write(file_, piece_));
  written_ += kPiece;
  disk_.start_write_out(file_);
  return std::optional<DiskSpeed>();
}

std::uint32_t DiskTest::percent(Instant now) const {
  const std::int64_t by_time = 100 * (now - start_).ms() / std::max<std::int64_t>(1, length_.ms());
  const auto by_bytes = static_cast<std::int64_t>(100 * written_ / std::max<std::uint64_t>(1, most_bytes_));
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(std::max(by_time, by_bytes), 0, 100));
}

}  // namespace nodal::firmware
