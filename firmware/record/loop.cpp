#include "firmware/record/loop.h"

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "firmware/record/stored_documents.h"
#include "firmware/record/take_manifest.h"
#include "protocol/base/try.h"
#include "protocol/take/evidence.h"
#include "protocol/take/tally.h"

namespace nodal::firmware {
namespace {

/// More than the first record of any evidence.
constexpr std::size_t kBeginBytes = 64 * 1024;

/// Index of a segment's first set.
Result<std::uint64_t> first_set_of(hal::DiskPort& disk, const std::string& evidence) {
  NODAL_TRY_ASSIGN(const auto file, disk.open_read(evidence));
  std::vector<std::uint8_t> bytes(kBeginBytes);
  const auto read = disk.read_at(file, 0, bytes);
  disk.close(file);
  if (!read) return fail(read.error());
  bytes.resize(*read);
  NODAL_TRY_ASSIGN(const auto found, take::read_evidence(bytes, evidence));
  return found.begin.first_set();
}

/// At which a minute has most sets.
FrameRate fastest_of(const take::Manifest& manifest, FrameRate fastest) {
  for (const take::RateChange& each : manifest.rates) {
    if (each.rate.period() < fastest.period()) fastest = each.rate;
  }
  return fastest;
}

Status remove_unlisted(hal::DiskPort& disk, const std::string& folder, const take::Manifest& manifest) {
  std::set<std::string, std::less<>> listed;
  for (const take::Manifest::File& file : manifest.files) listed.insert(file.name);
  NODAL_TRY_ASSIGN(const auto names, disk.list(folder));
  for (const std::string& name : names) {
    if (!take::segment_file(name) || listed.contains(name)) continue;
    NODAL_TRY(disk.remove(folder + "/" + name));
  }
  return {};
}

/// The documents of a finished take.
struct FinishedTake {
  FrameRate rate;
  take::Manifest manifest;
};
Result<FinishedTake> read_take(hal::DiskPort& disk, const std::string& folder) {
  NODAL_TRY_ASSIGN(const auto about, stored_take_json(disk, folder));
  NODAL_TRY_ASSIGN(auto manifest, stored_manifest(disk, folder));
  return FinishedTake{about.rate, std::move(manifest)};
}

/// The segments that are not near a mark, rising; at most `most` of them.
Result<std::vector<std::uint32_t>> deletable_segments(hal::DiskPort& disk, const std::string& folder,
                                                      const FinishedTake& take, std::size_t most = ~std::size_t{0}) {
  const take::Manifest& manifest = take.manifest;
  std::vector<std::uint32_t> segments = manifest.segments();
  if (manifest.marks.empty()) {
    segments.resize(std::min(segments.size(), most));
    return segments;
  }
  std::vector<std::uint32_t> found;
  for (std::size_t k = 0; k < segments.size() && found.size() < most; ++k) {
    // A segment ends where the next one begins. If others between them were deleted, it is near a mark anyway.
    std::uint64_t next = manifest.sets + manifest.deleted_sets;
    if (k + 1 < segments.size()) {
      NODAL_TRY_ASSIGN(const auto begin, first_set_of(disk, folder + "/" + take::evidence_file(segments[k + 1])));
      next = begin;
    }
    NODAL_TRY_ASSIGN(const auto first, first_set_of(disk, folder + "/" + take::evidence_file(segments[k])));
    if (!near_mark(first, std::max(next, first + 1) - 1, manifest.marks, fastest_of(manifest, take.rate)))
      found.push_back(segments[k]);
  }
  return found;
}

}  // namespace

bool near_mark(std::uint64_t first, std::uint64_t last, std::span<const take::Manifest::Mark> marks, FrameRate rate) {
  const auto margin = static_cast<std::uint64_t>(kKeptAroundMarks.ns() / std::max<std::int64_t>(1, rate.period().ns()));
  return std::ranges::any_of(marks,
                             [&](const auto& mark) { return first <= mark.set + margin && last + margin >= mark.set; });
}

Result<RoomInTake> room_in_take(hal::DiskPort& disk, const std::string& folder) {
  const auto take = read_take(disk, folder);
  if (!take) return fail(take.error());
  RoomInTake room;
  NODAL_TRY_ASSIGN(const auto chosen, deletable_segments(disk, folder, *take));
  for (const take::Manifest::File& file : take->manifest.files) {
    const auto named = take::segment_file(file.name);
    if (named && std::ranges::find(chosen, named->segment) != chosen.end()) room.bytes += file.bytes;
  }
  room.all = chosen.size() == take->manifest.segments().size();
  return room;
}

Result<std::optional<Trimmed>> trim_take(hal::DiskPort& disk, const std::string& folder) {
  auto take = read_take(disk, folder);
  if (!take) return fail(take.error());
  NODAL_TRY_ASSIGN(const auto deletable, deletable_segments(disk, folder, *take, 1));
  if (deletable.empty()) return std::optional<Trimmed>();
  const std::uint32_t chosen = deletable.front();
  take::Manifest* const manifest = &take->manifest;

  const std::string evidence_name = folder + "/" + take::evidence_file(chosen);
  NODAL_TRY_ASSIGN(const auto evidence, stored_evidence(disk, evidence_name));
  const std::uint64_t sets = std::min<std::uint64_t>(evidence.sets.size(), manifest->sets);
  Trimmed done;
  manifest->sets -= sets;
  manifest->deleted_sets += sets;
  const take::SegmentTally tally = take::tally_of(evidence, take->rate);
  const Duration length = evidence.sets.empty()
                              ? Duration()
                              : Duration::nanoseconds(evidence.sets.back().since_start_ns()) + tally.rate().period();
  manifest->length = std::max(Duration(), manifest->length - length);
  take::remove(manifest->gaps, tally.gaps());
  for (std::size_t head = 0; head < manifest->heads.size(); ++head)
    take::remove(manifest->heads[head], tally.heads()[head]);
  std::erase_if(manifest->files, [&](const take::Manifest::File& file) {
    const auto named = take::segment_file(file.name);
    if (!named || named->segment != chosen) return false;
    done.bytes += file.bytes;
    return true;
  });
  NODAL_TRY_ASSIGN(auto written, store_manifest(disk, folder, std::move(*manifest), Stored::kReplaced));
  NODAL_TRY(remove_unlisted(disk, folder, written));
  done.manifest = std::move(written);
  return std::optional<Trimmed>(std::move(done));
}

}  // namespace nodal::firmware
