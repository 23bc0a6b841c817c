#include "stitch/media/take/take_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "protocol/base/try.h"
#include "protocol/take/limits.h"

namespace nodal::media {
namespace {

using take::PieceHashes;

std::string_view text_of(const std::vector<std::uint8_t>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Error differs(const std::string& name, const std::string& how) {
  return {Errc::kChecksum, fmt::format("{}: {}; copy the take again, `nodal take verify` names all damage", name, how)};
}

}  // namespace

Result<std::vector<std::uint8_t>> read_take_file(TakeFiles& files, const std::string& name, std::uint64_t limit) {
  NODAL_TRY_ASSIGN(const auto file, files.open(name));
  if (file->size() > limit) {
    return fail(Errc::kTooLarge, fmt::format("{}: {} bytes; at most {}", files.shown(name), file->size(), limit));
  }
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(file->size()));
  NODAL_TRY(file->read(0, bytes));
  return bytes;
}

Result<std::vector<std::uint8_t>> read_manifest_file(TakeFiles& files) {
  auto listed = read_take_file(files, take::kManifestFile, take::kMaxManifestBytes);
  if (listed || listed.error().code != Errc::kNotFound) return listed;
  if (files.open(std::string(take::kManifestFile) + std::string(kPartSuffix))) {
    return fail(Errc::kNotReady,
                files.shown("") + ": the copy is not complete; the same `nodal offload` goes on with it");
  }
  if (!files.open(take::kTakeFile)) return listed;
  return fail(Errc::kNotReady, files.shown("") +
                                   ": has no manifest: the take was not ended. The rig finishes it when nodald "
                                   "starts; copy it again then");
}

Result<TakeFolder> TakeFolder::open(std::shared_ptr<TakeFiles> files) {
  TakeFolder take;
  take.files_ = std::move(files);
  const auto listed = read_manifest_file(*take.files_);
  const auto about = read_take_file(*take.files_, take::kTakeFile, take::kMaxTakeJsonBytes);
  if (!listed && listed.error().code != Errc::kNotFound) return fail(listed.error());
  if (!about) return fail(about.error());
  if (!listed) return fail(listed.error());
  NODAL_TRY_ASSIGN(auto document, take::parse_take_json(text_of(*about), take.shown(take::kTakeFile)));
  const std::string name = take.shown(take::kManifestFile);
  NODAL_TRY_ASSIGN(auto manifest, take::parse_manifest(text_of(*listed), name));
  if (manifest.number != document.number) {
    return fail(Errc::kBadFormat,
                fmt::format("{}: is of take {}, and take.json of take {}", name, manifest.number, document.number));
  }
  take.about_ = std::move(document);
  take.manifest_ = std::move(manifest);
  take.segments_ = take.manifest_.segments();
  NODAL_TRY(take.whole(take::kTakeFile, take::kMaxTakeJsonBytes));
  return take;
}

const take::Manifest::File* TakeFolder::find(const std::string& name) const {
  const auto found = std::ranges::find(manifest_.files, name, &take::Manifest::File::name);
  return found == manifest_.files.end() ? nullptr : &*found;
}

Result<std::vector<std::uint8_t>> TakeFolder::whole(const std::string& name, std::uint64_t limit) const {
  const take::Manifest::File* file = find(name);
  if (file == nullptr) {
    return fail(Errc::kNotFound, fmt::format("{}: does not list {}", shown(take::kManifestFile), name));
  }
  NODAL_TRY_ASSIGN(auto bytes, read_take_file(*files_, name, limit));
  PieceHashes hashes;
  hashes.update(bytes);
  if (bytes.size() != file->bytes || take::digest_of(hashes.all()) != file->digest) {
    return fail(differs(shown(name), "differs from the manifest"));
  }
  return bytes;
}

Result<std::string> TakeFolder::text(const std::string& name, std::uint64_t limit) const {
  NODAL_TRY_ASSIGN(const auto bytes, whole(name, limit));
  return std::string(text_of(bytes));
}

Result<TakeSegment> TakeFolder::segment(std::size_t k, SetsBefore before) const {
  const std::string name = take::evidence_file(segments_[k]);
  const std::string path = shown(name);
  NODAL_TRY_ASSIGN(const auto bytes, whole(name, take::kMaxEvidenceBytes));
  NODAL_TRY_ASSIGN(auto evidence, take::read_evidence(bytes, path));
  const auto wrong = [&](const std::string& what) { return fail(Errc::kBadFormat, path + ": " + what); };
  if (const Status good = check_segment(evidence, segments_[k], about_, before); !good) {
    return fail(good.error().in(path));
  }
  const std::uint64_t first_set = evidence.begin.first_set(), next = before.kept + before.deleted;
  if (first_set - before.kept > manifest_.deleted_sets) {
    return wrong(fmt::format("begins with set {} where {} comes next", first_set, next));
  }
  if (!evidence.end || evidence.good_bytes != bytes.size()) return wrong("has no end");
  const std::uint64_t sets = before.kept + evidence.sets.size();
  if (k + 1 == segments_.size() && sets != manifest_.sets) {
    return wrong(fmt::format("is the last, after {} sets, and the manifest says {} sets", sets, manifest_.sets));
  }
  TakeSegment segment;
  segment.before_ = {before.kept, first_set - before.kept};
  segment.evidence_ = std::move(evidence);
  NODAL_TRY(segment.open_files(*files_, manifest_));
  return segment;
}

Status TakeSegment::open_files(TakeFiles& files, const take::Manifest& manifest) {
  for (std::size_t k = 0; k < static_cast<std::size_t>(evidence_.begin.files_size()); ++k) {
    const int index = static_cast<int>(k);
    const std::string& name = streams_.emplace_back(take::stream_file(evidence_.begin.files(index))).name;
    const std::string shown = files.shown(name);
    NODAL_TRY_ASSIGN(auto file, files.open(name));
    const std::uint64_t length = evidence_.end->length(index);
    if (file->size() != length) {
      return fail(differs(shown, fmt::format("has {} bytes, not {}", file->size(), length)));
    }
    std::vector<take::Xxh128> hashes = evidence_.hashes_of(k);
    const auto listed = std::ranges::find(manifest.files, name, &take::Manifest::File::name);
    if (listed == manifest.files.end() || listed->bytes != length || listed->digest != take::digest_of(hashes)) {
      return fail(Errc::kBadFormat, shown + ": manifest and evidence do not say the same of it");
    }
    files_.push_back({std::move(file), shown, std::move(hashes)});
  }
  return {};
}

Status TakeSegment::load(File& file, std::uint64_t piece) {
  if (file.piece_number == piece) return {};
  file.piece_number.reset();
  const std::uint64_t from = piece * PieceHashes::kPiece;
  file.piece.resize(static_cast<std::size_t>(std::min(PieceHashes::kPiece, file.file->size() - from)));
  NODAL_TRY(file.file->read(from, file.piece));
  if (take::xxh128(file.piece) != file.hashes[static_cast<std::size_t>(piece)]) {
    return fail(differs(file.shown, fmt::format("its MiB at byte {} differs from what was recorded", from)));
  }
  file.piece_number = piece;
  return {};
}

Status TakeSegment::read(std::uint32_t file, std::uint64_t at, std::uint64_t bytes, std::vector<std::uint8_t>& into) {
  File& from = files_.at(file);
  if (bytes > take::kMaxTakePictureBytes || at > from.file->size() || bytes > from.file->size() - at) {
    return fail(Errc::kBadFormat, fmt::format("{}: {} bytes at byte {} are not a picture", from.shown, bytes, at));
  }
  into.resize(static_cast<std::size_t>(bytes));
  for (std::size_t done = 0; done < into.size();) {
    const std::uint64_t piece = (at + done) / PieceHashes::kPiece;
    NODAL_TRY(load(from, piece));
    const auto offset = static_cast<std::size_t>((at + done) % PieceHashes::kPiece);
    const std::size_t some = std::min(into.size() - done, from.piece.size() - offset);
    std::copy_n(from.piece.begin() + static_cast<std::ptrdiff_t>(offset), some,
                into.begin() + static_cast<std::ptrdiff_t>(done));
    done += some;
  }
  return {};
}

}  // namespace nodal::media
