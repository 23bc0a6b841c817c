#include "host_tool/offload/take_copy.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <system_error>
#include <utility>

#include "host_tool/console/files.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/console/quantities.h"
#include "host_tool/offload/local_file.h"
#include "host_tool/offload/take_fetch.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "protocol/take/evidence.h"
#include "stitch/media/take/take_files.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;
using take::PieceHashes;

const std::string kPart(media::kPartSuffix);

bool is_of(take::SegmentFile::Kind kind, const std::string& name) {
  const auto file = take::segment_file(name);
  return file && file->kind == kind;
}
bool is_evidence(const std::string& name) { return is_of(take::SegmentFile::Kind::kEvidence, name); }
bool is_video(const std::string& name) { return take::segment_file(name) && !is_evidence(name); }
bool of_a_head(const std::string& name) { return is_of(take::SegmentFile::Kind::kHead, name); }

std::uint64_t pieces_of(const take::Manifest::File& file) {
  return (file.bytes + PieceHashes::kPiece - 1) / PieceHashes::kPiece;
}

/// Whether all files of a take are in an earlier manifest of it.
bool holds_all(const take::Manifest& earlier, const take::Manifest& now) {
  return std::ranges::all_of(now.files, [&](const take::Manifest::File& file) {
    return std::ranges::find(earlier.files, file) != earlier.files.end();
  });
}

Error damaged(const std::string& file, std::uint64_t offset) {
  return {
      Errc::kChecksum,
      fmt::format("{}: what the rig sends from byte {} on differs from what was recorded, {} times: the rig's disk is "
                  "damaged there; copy what can be read with scp",
                  file, offset, TakeCopy::kTries)};
}

/// A file that is not there yet. What an interrupted call left of it is written again.
Status store(const fs::path& path, std::span<const std::uint8_t> bytes) {
  const fs::path part = path.string() + kPart;
  NODAL_TRY_ASSIGN(auto file, LocalFile::open_to_write(part));
  Status done = file.truncate(0);
  if (done) done = file.write(0, bytes);
  if (done) done = file.sync();
  return done ? rename_new(part, path) : done;
}

std::string_view text_of(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

Result<TakeCopy> TakeCopy::begin(RigConnection& rig, std::uint64_t take, const fs::path& to) {
  NODAL_TRY_ASSIGN(auto bytes, fetch_small_file(rig, take, take::kManifestFile, take::kMaxManifestBytes));
  NODAL_TRY_ASSIGN(auto manifest,
                   take::parse_manifest(text_of(bytes), fmt::format("the rig's manifest of take {}", take)));
  if (manifest.number != take) {
    return fail(Errc::kProtocol,
                fmt::format("the rig sent the manifest of take {} for take {}", manifest.number, take));
  }
  const fs::path folder = to / take::take_folder(take);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return fail(Errc::kIo, folder.string() + ": cannot be made: " + error.message());
  NODAL_TRY_ASSIGN(auto lock, FolderLock::take(folder));
  TakeCopy copy(rig, folder, std::move(lock));
  copy.id_ = sha256(bytes);
  copy.manifest_ = std::move(manifest);
  NODAL_TRY(copy.claim_folder(bytes));
  return copy;
}

/// Two rigs, or one whose card was replaced, have takes of the same number. The copy may be from before the rig deleted
/// segments of the take to make room.
Status TakeCopy::claim_folder(std::span<const std::uint8_t> manifest) {
  for (const std::string& name : {take::kManifestFile, take::kManifestFile + kPart}) {
    if (!length_of_file(folder_ / name)) continue;
    NODAL_TRY_ASSIGN(const auto existing, read_file((folder_ / name).string(), take::kMaxManifestBytes));
    if (existing == text_of(manifest)) return {};
    const auto earlier = take::parse_manifest(existing, (folder_ / name).string());
    if (earlier && holds_all(*earlier, manifest_)) {
      if (name == take::kManifestFile) return {};
      break;
    }
    return fail(Errc::kWrongState,
                fmt::format("{}: holds another take with this number; use another folder", folder_.string()));
  }
  // A folder without a manifest is somebody else's, so that not even a part of a file in it may be continued.
  if (!length_of_file(folder_ / (take::kManifestFile + kPart))) {
    NODAL_TRY(check_names(true));
  }
  const std::string part = (folder_ / (take::kManifestFile + kPart)).string();
  note_own(part);  // an earlier run's
  return write_file(part, text_of(manifest));
}

/// Nothing has the name of a file of the take but that file. `and_parts`: nor of a part of one.
Status TakeCopy::check_names(bool and_parts) const {
  for (const take::Manifest::File& file : manifest_.files) {
    for (const std::string& name : {file.name, file.name + kPart}) {
      if (name != file.name && !and_parts) continue;
      std::error_code unknown;
      if (!fs::exists(fs::symlink_status(folder_ / name, unknown))) continue;
      if (!and_parts && is_complete(file)) continue;
      return fail(
          Errc::kWrongState,
          fmt::format("{}: is there already, is not what the take has, and is never written over; move it away, or use "
                      "another folder",
                      (folder_ / name).string()));
    }
  }
  return {};
}

/// A file has its own name only after it was verified and synced.
bool TakeCopy::is_complete(const take::Manifest::File& file) const {
  return length_of_file(folder_ / file.name) == file.bytes;
}

bool TakeCopy::complete() const {
  return length_of_file(folder_ / take::kManifestFile) &&
         std::ranges::all_of(manifest_.files, [&](const auto& file) { return is_complete(file); });
}

std::uint64_t TakeCopy::bytes(bool without_heads) const {
  std::uint64_t sum = 0;
  for (const take::Manifest::File& file : manifest_.files)
    sum += without_heads && of_a_head(file.name) ? 0 : file.bytes;
  return sum;
}

Status TakeCopy::check_room(bool without_heads) const {
  std::uint64_t needed = 0;
  for (const take::Manifest::File& file : manifest_.files) {
    if ((without_heads && of_a_head(file.name)) || is_complete(file)) continue;
    needed += file.bytes - std::min(file.bytes, length_of_file(folder_ / (file.name + kPart)).value_or(0));
  }
  NODAL_TRY_ASSIGN(const auto free, free_bytes(folder_));
  if (free >= needed) return {};
  return fail(Errc::kDiskFull,
              fmt::format("{}: has room for {}, and {} are missing; use another folder, or --only raymap",
                          folder_.string(), show_bytes(free), show_bytes(needed)));
}

Status TakeCopy::run(bool without_heads, const OnProgress& progress) {
  NODAL_TRY(check_names(false));
  NODAL_TRY(check_room(without_heads));
  done_ = 0;
  without_heads_ = without_heads;
  for (const bool video : {false, true}) {  // the evidence has the hashes of the video files
    for (const take::Manifest::File& file : manifest_.files) {
      if (is_video(file.name) != video || (without_heads && of_a_head(file.name))) continue;
      if (is_complete(file) && !is_evidence(file.name)) {
        done_ += file.bytes;
        progress(done_, file.name);
        continue;
      }
      NODAL_TRY(video ? copy_video(file, progress) : copy_document(file, progress));
    }
  }
  if (without_heads) return sync_folder(folder_);
  if (length_of_file(folder_ / take::kManifestFile)) return sync_folder(folder_);
  Status done = sync_folder(folder_);
  if (done) done = rename_new(folder_ / (take::kManifestFile + kPart), folder_ / take::kManifestFile);
  if (done) done = sync_folder(folder_);
  if (done) done = sync_folder(folder_ / "..");
  return done;
}

/// Documents and evidence: compared with the manifest as a whole. Evidence that is there is only read for its hashes;
/// if it was changed, it stays as it is, and the copy ends.
Status TakeCopy::copy_document(const take::Manifest::File& file, const OnProgress& progress) {
  const fs::path path = folder_ / file.name;
  const auto good = [&](std::span<const std::uint8_t> bytes) {
    PieceHashes hashes;
    hashes.update(bytes);
    return bytes.size() == file.bytes && take::digest_of(hashes.all()) == file.digest;
  };
  Bytes bytes;
  bool whole = false;
  if (is_complete(file)) {
    NODAL_TRY_ASSIGN(const auto text, read_file(path.string(), take::kMaxEvidenceBytes));
    bytes.assign(text.begin(), text.end());
    whole = good(bytes);
    if (!whole) {
      return fail(Errc::kWrongState,
                  fmt::format("{}: is not what the take has, and is never written over; move it away, and the "
                              "same command fetches it again",
                              path.string()));
    }
  }
  for (int k = 0; k < kTries && !whole; ++k) {
    NODAL_TRY_ASSIGN(auto fetched, fetch_small_file(*rig_, manifest_.number, file.name, take::kMaxEvidenceBytes));
    bytes = std::move(fetched);
    fetched_ += bytes.size();
    whole = good(bytes);
    if (!whole) continue;
    NODAL_TRY(store(path, bytes));
  }
  if (!whole) return fail(damaged(file.name, 0));
  done_ += file.bytes;
  progress(done_, file.name);
  if (!is_evidence(file.name)) return {};
  return note_hashes(file, bytes);
}

/// Keeps the hashes of files of the manifest only, and only as many as their lengths need.
Status TakeCopy::note_hashes(const take::Manifest::File& file, std::span<const std::uint8_t> evidence) {
  NODAL_TRY_ASSIGN(const auto segment, take::read_evidence(evidence, file.name));
  for (int k = 0; k < segment.begin.files_size(); ++k) {
    const std::string& name = segment.begin.files(k).name();
    const auto listed = std::ranges::find(manifest_.files, name, &take::Manifest::File::name);
    if (listed == manifest_.files.end() || (without_heads_ && of_a_head(name))) continue;
    std::vector<take::Xxh128> hashes = segment.hashes_of(static_cast<std::size_t>(k));
    if (hashes.size() == pieces_of(*listed) && take::digest_of(hashes) == listed->digest)
      hashes_[name] = std::move(hashes);
  }
  return {};
}

Status TakeCopy::copy_video(const take::Manifest::File& file, const OnProgress& progress) {
  const auto expected = hashes_.find(file.name);
  const std::uint64_t pieces = pieces_of(file);
  if (expected == hashes_.end()) {
    return fail(Errc::kBadFormat,
                fmt::format("{}: the evidence of take {} does not have its hashes", file.name, manifest_.number));
  }
  NODAL_TRY_ASSIGN(auto part, LocalFile::open_to_write(folder_ / (file.name + kPart)));
  NODAL_TRY_ASSIGN(const auto size, part.size());
  // Keeps the pieces of an earlier copy up to the first one with a wrong hash.
  std::uint64_t at = 0;
  Bytes piece(PieceHashes::kPiece);
  while (at < size) {
    NODAL_TRY_ASSIGN(const auto got, part.read(at, piece));
    const std::size_t whole =
        static_cast<std::size_t>(std::min(PieceHashes::kPiece, file.bytes - std::min(at, file.bytes)));
    if (got < whole || whole == 0) break;
    if (take::xxh128(std::span(piece).first(whole)) != expected->second[at / PieceHashes::kPiece]) break;
    at += whole;
    done_ += whole;
    progress(done_, file.name);
  }
  NODAL_TRY(part.truncate(at));
  for (int tries = kTries; at < file.bytes;) {
    const std::uint64_t before = at;
    bool differs = false;
    const Status fetched = fetch_file(*rig_, manifest_.number, file.name, at,
                                      [&](std::uint64_t offset, std::span<const std::uint8_t> bytes) -> Status {
                                        fetched_ += bytes.size();
                                        const std::uint64_t k = offset / PieceHashes::kPiece;
                                        if (k >= pieces || take::xxh128(bytes) != expected->second[k]) {
                                          differs = true;
                                          return fail(Errc::kChecksum, file.name + ": differs");
                                        }
                                        NODAL_TRY(part.write(offset, bytes));
                                        at = offset + bytes.size();
                                        done_ += bytes.size();
                                        progress(done_, file.name);
                                        return {};
                                      });
    if (!fetched && !differs) return fetched;
    if (at > before) tries = kTries;
    if (at < file.bytes && --tries == 0) return fail(damaged(file.name, at));
  }
  NODAL_TRY(part.sync());
  return rename_new(folder_ / (file.name + kPart), folder_ / file.name);
}

}  // namespace nodal::host
