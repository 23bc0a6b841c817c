#include "stitch/media/take/take_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "protocol/take/seam_map.h"
#include "stitch/media/ut_video.h"

namespace nodal::media {
namespace {

using take::PieceHashes;

constexpr std::string_view kEvidence = "evidence-";

std::string_view text_of(const std::vector<std::uint8_t>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Fields fields_named(std::string_view name) {
  if (name == "top-first") return Fields::kTopFirst;
  return name == "bottom-first" ? Fields::kBottomFirst : Fields::kProgressive;
}

TakeStream stream_of(const take::wire::File& file) {
  TakeStream stream;
  stream.file = file.name();
  if (file.has_head()) stream.head = file.head();
  stream.format = pixel_format_named(file.format()).value_or(PixelFormat::kMjpeg);  // read_evidence() has checked it
  stream.width = static_cast<int>(file.width());
  stream.height = static_cast<int>(file.height());
  stream.coding = {.video_range = file.video_range(), .bt709 = file.bt709()};
  stream.fields = fields_named(file.fields());
  stream.lossless = file.lossless();
  return stream;
}

Error differs(const std::string& name, const std::string& how) {
  return {Errc::kChecksum, fmt::format("{}: {}; copy the take again, `nodal take verify` names all damage", name, how)};
}

}  // namespace

Result<std::vector<std::uint8_t>> read_take_file(TakeFiles& files, const std::string& name, std::uint64_t limit) {
  const auto file = files.open(name);
  if (!file) return fail(file.error());
  if ((*file)->size() > limit) {
    return fail(Errc::kTooLarge, fmt::format("{}: {} bytes; at most {}", files.shown(name), (*file)->size(), limit));
  }
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>((*file)->size()));
  if (const Status read = (*file)->read(0, bytes); !read) return fail(read.error());
  return bytes;
}

Result<TakeFolder> TakeFolder::open(std::shared_ptr<TakeFiles> files) {
  TakeFolder take;
  take.files_ = std::move(files);
  const auto about = read_take_file(*take.files_, take::kTakeFile, take::kMaxTakeJsonBytes);
  if (!about) return fail(about.error());
  auto document = take::parse_take_json(text_of(*about), take.shown(take::kTakeFile));
  if (!document) return fail(document.error());
  const auto listed = read_take_file(*take.files_, take::kManifestFile, take::kMaxManifestBytes);
  if (!listed && listed.error().code == Errc::kNotFound) {
    return fail(Errc::kNotReady, take.shown("") +
                                     ": has no manifest: the take was not ended. The rig finishes it when nodald "
                                     "starts; copy it again then");
  }
  if (!listed) return fail(listed.error());
  const std::string name = take.shown(take::kManifestFile);
  auto manifest = take::parse_manifest(text_of(*listed), name);
  if (!manifest) return fail(manifest.error());
  if (manifest->number != document->number) {
    return fail(Errc::kBadFormat,
                fmt::format("{}: is of take {}, and take.json of take {}", name, manifest->number, document->number));
  }
  take.about_ = std::move(*document);
  take.manifest_ = std::move(*manifest);
  for (const take::Manifest::File& file : take.manifest_.files) {
    if (!file.name.starts_with(kEvidence)) continue;
    take.segments_.push_back(static_cast<std::uint32_t>(std::stoul(file.name.substr(kEvidence.size()))));
  }
  std::ranges::sort(take.segments_);
  if (const auto whole = take.whole(take::kTakeFile, take::kMaxTakeJsonBytes); !whole) return fail(whole.error());
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
  auto bytes = read_take_file(*files_, name, limit);
  if (!bytes) return bytes;
  PieceHashes hashes;
  hashes.update(*bytes);
  if (bytes->size() != file->bytes || take::digest_of(hashes.all()) != file->digest) {
    return fail(differs(shown(name), "differs from the manifest"));
  }
  return bytes;
}

Result<std::string> TakeFolder::text(const std::string& name, std::uint64_t limit) const {
  const auto bytes = whole(name, limit);
  if (!bytes) return fail(bytes.error());
  return std::string(text_of(*bytes));
}

Result<TakeSegment> TakeFolder::segment(std::size_t k, SetsBefore before) const {
  const std::string name = take::evidence_file(segments_[k]);
  const std::string path = shown(name);
  const auto bytes = whole(name, take::kMaxEvidenceBytes);
  if (!bytes) return fail(bytes.error());
  auto evidence = take::read_evidence(*bytes, path);
  if (!evidence) return fail(evidence.error());
  const auto wrong = [&](const std::string& what) { return fail(Errc::kBadFormat, path + ": " + what); };
  if (evidence->begin.take() != about_.number || evidence->begin.segment() != segments_[k]) {
    return wrong(fmt::format("is of take {}, segment {}", evidence->begin.take(), evidence->begin.segment()));
  }
  const std::uint64_t first_set = evidence->begin.first_set(), next = before.kept + before.deleted;
  if (first_set < next || first_set - before.kept > manifest_.deleted_sets) {
    return wrong(fmt::format("begins with set {} where {} comes next", first_set, next));
  }
  if (!evidence->end || evidence->good_bytes != bytes->size()) return wrong("has no end");
  const std::uint64_t sets = before.kept + evidence->sets.size();
  if (k + 1 == segments_.size() && sets != manifest_.sets) {
    return wrong(fmt::format("is the last, after {} sets, and the manifest says {} sets", sets, manifest_.sets));
  }
  TakeSegment segment;
  segment.before_ = {before.kept, first_set - before.kept};
  segment.evidence_ = std::move(*evidence);
  if (const Status opened = segment.open_files(*files_, manifest_); !opened) return fail(opened.error());
  for (const take::wire::Set& set : segment.evidence_.sets) {
    for (const take::wire::Frame& frame : set.frames()) {
      if (const Status good = segment.check_frame(frame, set.index()); !good) return fail(good.error().in(path));
    }
  }
  for (const take::wire::Seams& seams : segment.evidence_.seams) {
    if (const Status good = take::check_seams(seams, about_.heads.size()); !good) return fail(good.error().in(path));
  }
  for (const TakeStream& stream : segment.streams_) {
    if (!stream.head || *stream.head < about_.heads.size()) continue;
    return wrong(
        fmt::format("has pictures of head {}, and take.json names {} heads", *stream.head, about_.heads.size()));
  }
  return segment;
}

Status TakeSegment::open_files(TakeFiles& files, const take::Manifest& manifest) {
  for (std::size_t k = 0; k < static_cast<std::size_t>(evidence_.begin.files_size()); ++k) {
    const int index = static_cast<int>(k);
    streams_.push_back(stream_of(evidence_.begin.files(index)));
    const std::string shown = files.shown(streams_.back().file);
    auto file = files.open(streams_.back().file);
    if (!file) return fail(file.error());
    const std::uint64_t length = evidence_.end->length(index);
    if ((*file)->size() != length) {
      return fail(differs(shown, fmt::format("has {} bytes, not {}", (*file)->size(), length)));
    }
    std::vector<take::Xxh128> hashes = evidence_.hashes_of(k);
    const auto listed = std::ranges::find(manifest.files, streams_.back().file, &take::Manifest::File::name);
    if (listed == manifest.files.end() || listed->bytes != length || listed->digest != take::digest_of(hashes)) {
      return fail(Errc::kBadFormat, shown + ": manifest and evidence do not say the same of it");
    }
    files_.push_back({std::move(*file), shown, std::move(hashes)});
  }
  return {};
}

Status TakeSegment::check_frame(const take::wire::Frame& frame, std::uint64_t set) const {
  const TakeStream& stream = streams_[frame.file()];
  const auto wrong = [&](std::uint64_t most) {
    return fail(Errc::kBadFormat, fmt::format("set {}: {} bytes of {} at byte {}; a {} picture of {}x{} has {}", set,
                                              frame.bytes(), stream.file, frame.at(), pixel_format_name(stream.format),
                                              stream.width, stream.height, most));
  };
  if (stream.lossless && !ut_video_codes(stream.format, stream.width, stream.height)) {
    return fail(Errc::kBadFormat,
                fmt::format("set {}: {} has pictures of {} {}x{}, which Ut Video does not code", set, stream.file,
                            pixel_format_name(stream.format), stream.width, stream.height));
  }
  const bool jpeg = stream.format == PixelFormat::kMjpeg;
  const std::uint64_t expected = jpeg              ? kMaxTakePictureBytes
                                 : stream.lossless ? ut_video_most_bytes(stream.format, stream.width, stream.height)
                                                   : packed_size(stream.format, stream.width, stream.height);
  if (jpeg || stream.lossless ? frame.bytes() == 0 || frame.bytes() > expected : frame.bytes() != expected)
    return wrong(expected);
  if (expected > kMaxTakePictureBytes) {
    return fail(Errc::kTooLarge, fmt::format("set {}: a picture of {} has {} bytes; at most {} are read", set,
                                             stream.file, expected, kMaxTakePictureBytes));
  }
  return {};
}

Status TakeSegment::load(File& file, std::uint64_t piece) {
  if (file.piece_number == piece) return {};
  file.piece_number.reset();
  const std::uint64_t from = piece * PieceHashes::kPiece;
  file.piece.resize(static_cast<std::size_t>(std::min(PieceHashes::kPiece, file.file->size() - from)));
  if (const Status read = file.file->read(from, file.piece); !read) return read;
  if (take::xxh128(file.piece) != file.hashes[static_cast<std::size_t>(piece)]) {
    return fail(differs(file.shown, fmt::format("its MiB at byte {} differs from what was recorded", from)));
  }
  file.piece_number = piece;
  return {};
}

Status TakeSegment::read(std::uint32_t file, std::uint64_t at, std::uint64_t bytes, std::vector<std::uint8_t>& into) {
  File& from = files_.at(file);
  if (bytes > kMaxTakePictureBytes || at > from.file->size() || bytes > from.file->size() - at) {
    return fail(Errc::kBadFormat, fmt::format("{}: {} bytes at byte {} are not a picture", from.shown, bytes, at));
  }
  into.resize(static_cast<std::size_t>(bytes));
  for (std::size_t done = 0; done < into.size();) {
    const std::uint64_t piece = (at + done) / PieceHashes::kPiece;
    if (const Status loaded = load(from, piece); !loaded) return loaded;
    const auto offset = static_cast<std::size_t>((at + done) % PieceHashes::kPiece);
    const std::size_t some = std::min(into.size() - done, from.piece.size() - offset);
    std::copy_n(from.piece.begin() + static_cast<std::ptrdiff_t>(offset), some,
                into.begin() + static_cast<std::ptrdiff_t>(done));
    done += some;
  }
  return {};
}

}  // namespace nodal::media
