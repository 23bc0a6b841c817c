// The folder of a take, as it may come from anywhere. The input's first byte selects: take.json, the manifest, the
// records of a flight record, a lossless picture, or the records of an evidence, which get the framing, the file and
// the hashes that their own numbers ask for, so that what is wrong is only what they say. Either an error says what is
// wrong, or every picture that is given lies in memory of its own.
#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <string>

#include "memory_limit.h"
#include "protocol/base/bytes.h"
#include "protocol/framing.h"
#include "protocol/take/digest.h"
#include "protocol/take/seam_map.h"
#include "stitch/media/take/take_folder.h"
#include "stitch/media/ut_video.h"
#include "tests/sim/flight_reader.h"

namespace {

using namespace nodal;
using Bytes = std::vector<std::uint8_t>;

class InMemory final : public media::TakeFiles {
 public:
  std::map<std::string, Bytes> files;

  Result<std::unique_ptr<media::TakeFile>> open(const std::string& name) override {
    NODAL_ASSERT(name.find('/') == std::string::npos && name.size() < 100);
    const auto found = files.find(name);
    if (found == files.end()) return fail(Errc::kNotFound, name + ": is not there");
    return std::make_unique<File>(found->second);
  }
  std::string shown(const std::string& name) const override { return "take/" + name; }

 private:
  class File final : public media::TakeFile {
   public:
    explicit File(const Bytes& bytes) : bytes_(bytes) {}
    std::uint64_t size() const override { return bytes_.size(); }
    Status read(std::uint64_t at, std::span<std::uint8_t> into) override {
      NODAL_ASSERT(at <= bytes_.size() && into.size() <= bytes_.size() - at);
      std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), into.size(), into.begin());
      return {};
    }

   private:
    const Bytes& bytes_;
  };
};

void check(const Error& error) { NODAL_ASSERT(!error.message.empty() && error.message.size() < 2000); }

take::Manifest::File listed(const std::string& name, const Bytes& bytes) {
  take::PieceHashes hashes;
  hashes.update(bytes);
  return {name, bytes.size(), take::digest_of(hashes.all())};
}

/// Records one after the other: two bytes of length, then a Record. An End gets the hashes of the files that it
/// describes.
void add_evidence(ByteReader in, InMemory& folder, take::Manifest& manifest) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 18;
  take::EvidenceWriter writer;
  Bytes evidence;
  std::vector<std::string> names;
  while (in.left() > 2) {
    const auto text = in.bytes(std::min<std::size_t>(in.u16(), in.left()));
    take::wire::Record record;
    if (!record.ParseFromArray(text.data(), static_cast<int>(text.size()))) continue;
    if (record.has_begin()) {
      names.clear();
      manifest.deleted_sets = record.begin().first_set();
      for (const take::wire::File& file : record.begin().files()) names.push_back(file.name());
    }
    if (record.has_end()) {
      take::wire::End& end = *record.mutable_end();
      manifest.sets = end.sets() - std::min(end.sets(), manifest.deleted_sets);
      for (int k = 0; k < std::min({end.length_size(), end.hashes_size(), static_cast<int>(names.size())}); ++k) {
        Bytes video(static_cast<std::size_t>(std::min(end.length(k), kMaxBytes)), static_cast<std::uint8_t>(k));
        const take::Xxh128 hash = take::xxh128(video);
        end.set_hashes(k, std::string(hash.begin(), hash.end()));
        const std::string& name = names[static_cast<std::size_t>(k)];
        if (!take::is_take_file(name) || folder.files.contains(name)) continue;
        manifest.files.push_back(listed(name, video));
        folder.files[name] = std::move(video);
      }
    }
    const Bytes more = writer.encode(record);
    evidence.insert(evidence.end(), more.begin(), more.end());
  }
  manifest.files.push_back(listed("evidence-0000", evidence));
  folder.files["evidence-0000"] = std::move(evidence);
}

void read_all(const media::TakeFolder& folder) {
  media::TakeSets sets(folder);
  media::TakeSet set;
  for (std::uint64_t count = 0;; ++count) {
    const auto more = sets.next(set);
    if (!more) return check(more.error());
    if (!*more) {
      NODAL_ASSERT(count == folder.manifest().sets);
      return;
    }
    NODAL_ASSERT(set.evidence.index() == count + folder.manifest().deleted_sets);
    if (const Status read = sets.read_pictures(set); !read) check(read.error());
    if (const auto& seams = sets.segment().evidence().seams; !seams.empty()) {
      const auto labels = take::labels_of(seams.back());
      NODAL_ASSERT(labels && labels->size() == seams.back().columns() * (seams.back().columns() / 2));
      for (const std::uint8_t head : *labels)
        NODAL_ASSERT(head < folder.about().heads.size() || head == take::kNoHeadOfSeams);
    }
    for (std::size_t head = 0; head < kMaxHeads; ++head) {
      const ImageView& image = set.heads[head].image;
      if (image.planes[0].data == nullptr) continue;
      NODAL_ASSERT(head < folder.about().heads.size() && set.heads[head].present);
      // The last byte of every plane is inside of the head's memory.
      for (const PlaneView& plane : image.planes) {
        if (plane.data == nullptr) continue;
        const std::uint8_t* const last = plane.data + (plane.height - 1) * plane.row_stride + plane.width - 1;
        NODAL_ASSERT(plane.data >= set.bytes[head].data() && last < set.bytes[head].data() + set.bytes[head].size());
      }
    }
  }
}

/// The first byte selects the format.
void decode_lossless(std::span<const std::uint8_t> frame) {
  constexpr int kWidth = 18, kHeight = 10;
  constexpr std::array kFormats = {PixelFormat::kI420, PixelFormat::kYuyv, PixelFormat::kRgb24, PixelFormat::kNv12};
  if (frame.empty()) return;
  const PixelFormat format = kFormats[frame[0] % kFormats.size()];
  Bytes picture;
  const Status decoded = media::decode_ut_video(frame.subspan(1), format, kWidth, kHeight, picture);
  if (!decoded) return check(decoded.error());
  NODAL_ASSERT(picture.size() == packed_size(format, kWidth, kHeight));
  // What was decoded is coded to something that is decoded to the same.
  Bytes coded, again;
  media::UtVideoEncoder().encode(packed_image(format, kWidth, kHeight, std::as_const(picture).data()), coded);
  NODAL_ASSERT(coded.size() <= media::ut_video_most_bytes(format, kWidth, kHeight));
  NODAL_ASSERT(media::decode_ut_video(coded, format, kWidth, kHeight, again).has_value() && again == picture);
}

/// Records one after the other, as in add_evidence().
void read_flight(ByteReader in) {
  Bytes flight;
  std::uint32_t sequence = 0;
  while (in.left() > 2) {
    const auto payload = in.bytes(std::min<std::size_t>(in.u16(), in.left()));
    const auto head = encode_frame_header({FrameType::kTakeRecord, 0, 0, sequence++}, payload);
    flight.insert(flight.end(), head.begin(), head.end());
    flight.insert(flight.end(), payload.begin(), payload.end());
  }
  auto reader = flight::FlightReader::open(flight, "take/flight");
  if (!reader) return check(reader.error());
  for (;;) {
    const auto step = reader->next_step();
    if (!step) return check(step.error());
    if (step->empty()) return;
    NODAL_ASSERT(std::holds_alternative<firmware::StepBegun>(step->front()));
    NODAL_ASSERT(step->size() <= flight::FlightReader::kMaxEventsInStep);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool limited = (fuzz::limit_memory(std::size_t{256} << 20), true);
  (void)limited;
  if (size == 0 || size > (1U << 16)) return 0;
  if (data[0] % 5 == 4) {
    decode_lossless({data + 1, size - 1});
    return 0;
  }
  if (data[0] % 5 == 3) {
    read_flight(ByteReader({data + 1, size - 1}));
    return 0;
  }
  const std::string rest(reinterpret_cast<const char*>(data + 1), size - 1);
  auto files = std::make_shared<InMemory>();
  take::TakeDocument about;
  about.rig = "rig";
  about.software = "fuzz";
  about.mode = "driver";
  about.heads = {"a", "b", "c"};
  take::Manifest manifest;
  manifest.ended = "stopped";
  const std::string take_json = data[0] % 5 == 0 ? rest : take::take_json(about);
  files->files[take::kTakeFile] = Bytes(take_json.begin(), take_json.end());
  manifest.files.push_back(listed(take::kTakeFile, files->files[take::kTakeFile]));
  if (data[0] % 5 == 2) add_evidence(ByteReader({data + 1, size - 1}), *files, manifest);
  const std::string text = data[0] % 5 == 1 ? rest : take::manifest_json(manifest);
  files->files[take::kManifestFile] = Bytes(text.begin(), text.end());
  const auto folder = media::TakeFolder::open(files);
  if (!folder) {
    check(folder.error());
    return 0;
  }
  read_all(*folder);
  return 0;
}
