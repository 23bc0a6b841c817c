#include "host_tool/input/live_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "host_tool/console/quantities.h"
#include "host_tool/input/head_frame.h"
#include "host_tool/rig/bulk_item.h"
#include "host_tool/rig/frame_period.h"
#include "host_tool/rig/rig_input.h"
#include "host_tool/rig/stream_wait.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"
#include "stitch/media/image_file.h"

namespace nodal::host {
namespace {

constexpr Duration kBetweenSets = Duration::milliseconds(250);  // so that moving objects have moved
constexpr std::uint64_t kMaxSetBytes = 1ULL << 30;
// The rig copies one set at a time, also for other hosts; a set that has just arrived may still be open there.
constexpr Duration kBusyRest = Duration::milliseconds(2);
constexpr int kBusyTries = 1000;
constexpr int kTries = 20;  // to get a set with all heads: 5 s

struct ReceivedSet {
  wire::FrameSetHeader header;
  std::vector<std::uint8_t> bytes;
};

/// The number of bytes of a head's picture; checks that its format and size are valid for a rig.
Result<std::uint64_t> picture_bytes(const wire::HeadPicture& head) {
  const auto format = pixel_format_named(head.format());
  const bool sane = format && !is_linear16(*format) && head.width() > 0 && head.height() > 0 &&
                    head.width() <= media::kMaxImageSide && head.height() <= media::kMaxImageSide;
  if (!sane) return fail(Errc::kBadFormat, "head '" + head.name() + "': the rig sent a picture of an unknown format");
  const int width = static_cast<int>(head.width());
  const int height = static_cast<int>(head.height());
  if (*format != PixelFormat::kMjpeg) return packed_size(*format, width, height);
  if (head.jpeg_bytes() > packed_size(PixelFormat::kI420, width, height)) {
    return fail(Errc::kTooLarge,
                fmt::format("head '{}': the rig sent a JPEG of {} bytes, more than the picture itself has", head.name(),
                            head.jpeg_bytes()));
  }
  return head.jpeg_bytes();
}

/// Reads the header; returns the total bytes of its pictures, which is the set's limit.
Result<std::uint64_t> read_header(const BulkPiece& first, wire::FrameSetHeader& header) {
  NODAL_TRY_ASSIGN(wire::FrameSetHeader read, parse_clean<wire::FrameSetHeader>(first.meta, "header of a frame set"));
  header = std::move(read);
  std::uint64_t sum = 0;
  std::uint64_t decoded = 0;
  for (const wire::HeadPicture& head : header.heads()) {
    NODAL_TRY_ASSIGN(const std::uint64_t bytes, picture_bytes(head));
    sum += bytes;
    decoded += packed_size(PixelFormat::kI420, static_cast<int>(head.width()), static_cast<int>(head.height()));
  }
  if (decoded > kMaxSetBytes) {
    return fail(Errc::kTooLarge, fmt::format("the rig sent a frame set of more than {} MiB", kMaxSetBytes >> 20));
  }
  return std::min(sum, kMaxSetBytes);
}

Result<ReceivedSet> receive_set(RigConnection& rig, Duration within) {
  wire::Request request;
  request.mutable_frame_set();
  NODAL_TRY_ASSIGN(const wire::Reply started, rig.ask(request));
  const StreamId stream = started.pull().stream();
  ReceivedSet set;
  BulkItemBytes bytes;
  bool begun = false;
  bool whole = false;
  StreamWait wait(rig, stream, within, "a frame set");
  while (true) {
    NODAL_TRY_ASSIGN(const Event event, wait.next());
    if (const auto* piece = std::get_if<BulkPiece>(&event)) {
      if (piece->first) {
        if (begun) return fail(Errc::kProtocol, "the rig sent a second frame set; one was asked for");
        begun = true;
        NODAL_TRY_ASSIGN(const std::uint64_t most, read_header(*piece, set.header));
        NODAL_TRY(bytes.begin(*piece, most, "a frame set"));
      }
      bytes.add(*piece);
      whole = piece->last;
    } else if (const auto* closed = std::get_if<StreamClosed>(&event)) {
      if (closed->error) return fail(*closed->error);
      if (!whole) return fail(Errc::kTruncated, "the rig ended a frame set before it was complete");
      set.bytes = bytes.take();
      return set;
    }
  }
}

Result<DecodedImage> picture_of(const ReceivedSet& set, const wire::HeadPicture& head) {
  NODAL_TRY_ASSIGN(const std::uint64_t bytes, picture_bytes(head));
  if (head.offset() > set.bytes.size() || set.bytes.size() - head.offset() < bytes) {
    return fail(Errc::kTruncated, "head '" + head.name() + "': its picture is incomplete");
  }
  const std::uint8_t* const begin = set.bytes.data() + head.offset();
  const PixelFormat delivered = *pixel_format_named(head.format());
  const int width = static_cast<int>(head.width());
  const int height = static_cast<int>(head.height());
  ImageView frame{delivered, width, height, {}, static_cast<std::size_t>(bytes)};
  if (delivered == PixelFormat::kMjpeg) {
    frame.planes[0].data = begin;
  } else {
    frame = packed_image(delivered, width, height, begin);
  }
  frame.coding = {head.video_range(), head.bt709()};
  return picture_of_frame(frame, head.name());
}

/// Null if the head has no picture in the set.
const wire::HeadPicture* picture_named(const wire::FrameSetHeader& set, const std::string& head) {
  const auto found = std::ranges::find(set.heads(), head, &wire::HeadPicture::name);
  return found == set.heads().end() ? nullptr : &*found;
}

/// Frame sets in a row that lack heads, and which heads these are.
class Missed {
 public:
  explicit Missed(const std::vector<std::string>& heads) {
    for (const std::string& head : heads) heads_.push_back({head, 0});
  }
  int sets() const { return sets_; }
  /// Whether the set lacks a head; then it is counted.
  bool counts(const wire::FrameSetHeader& set) {
    bool any = false;
    for (auto& [head, missed] : heads_) {
      if (picture_named(set, head) != nullptr) continue;
      ++missed;
      any = true;
    }
    sets_ += any ? 1 : 0;
    return any;
  }
  /// Why no whole set was received: a head that is in none, or too many lost frames.
  Error error() const {
    const auto worst = std::ranges::max_element(heads_, {}, &Head::missed);
    if (worst->missed == sets_) {
      return {Errc::kDeviceGone, fmt::format("head '{}' delivers no pictures; `nodal heads` says why", worst->name)};
    }
    return {Errc::kOverload, fmt::format("{} frame sets in a row lack a head (most often '{}': {} times): frames are "
                                         "lost; `nodal status` shows where",
                                         sets_, worst->name, worst->missed)};
  }

 private:
  struct Head {
    std::string name;
    int missed = 0;
  };
  std::vector<Head> heads_;
  int sets_ = 0;
};

/// The pictures in the order of the heads, all of which are in the set.
Result<std::vector<HeadPicture>> pictures_of(const ReceivedSet& set, const std::vector<std::string>& heads) {
  std::vector<HeadPicture> pictures;
  for (const std::string& head : heads) {
    const wire::HeadPicture* const found = picture_named(set.header, head);
    NODAL_ASSERT(found != nullptr);
    NODAL_TRY_ASSIGN(DecodedImage picture, picture_of(set, *found));
    pictures.emplace_back(std::move(picture));
  }
  return pictures;
}

double mean_of(const DecodedImage& picture) {
  const bool packed = picture.format == PixelFormat::kYuyv || picture.format == PixelFormat::kUyvy;
  const std::size_t pixels = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
  const std::size_t first = picture.format == PixelFormat::kUyvy ? 1 : 0;
  const std::size_t stride = packed ? 2 : 1;
  const std::size_t samples = picture.format == PixelFormat::kRgb24 ? 3 * pixels : pixels;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < samples; ++i) sum += picture.bytes[first + stride * i];
  return static_cast<double>(sum) / static_cast<double>(samples);
}

}  // namespace

Result<std::optional<HeadSample>> sample_head(RigConnection& rig, std::uint32_t head, Duration within) {
  Result<ReceivedSet> set = receive_set(rig, within);
  // Older rigs refuse while they send another set; newer ones let the request wait.
  for (int tries = 1; !set && set.error().code == Errc::kBusy && tries < kBusyTries; ++tries) {
    NODAL_TRY(rig.rest(kBusyRest));
    set = receive_set(rig, within);
  }
  if (!set) return fail(set.error());
  const auto found = std::ranges::find(set->header.heads(), head, &wire::HeadPicture::index);
  if (found == set->header.heads().end()) return std::nullopt;
  NODAL_TRY_ASSIGN(const DecodedImage picture, picture_of(*set, *found));
  return HeadSample{set->header.mid_exposure_ns(), found->exposure_ns(), mean_of(picture)};
}

Status require_feature(const RigConnection& rig, const std::string& feature, const std::string& what) {
  const auto& features = rig.rig().features();
  if (std::ranges::find(features, feature) != features.end()) return {};
  return fail(Errc::kUnsupported, fmt::format("{} needs a newer nodald on the rig; {} at {} does not have it", what,
                                              rig.rig().software(), rig.address()));
}

Result<Calibration> calibration_in_force(RigConnection& rig) {
  wire::Request request;
  request.mutable_calibration_get();
  const Result<wire::Reply> reply = rig.ask(request);
  if (!reply && reply.error().code == Errc::kNotFound) {
    return fail(Errc::kNotFound, reply.error().message +
                                     "; `nodal register -o first.json` finds one in what the heads see, and `nodal "
                                     "calibration upload first.json` puts it in force");
  }
  if (!reply) return fail(reply.error());
  Result<Calibration> calibration = parse_calibration(reply->calibration().json());
  if (!calibration) return fail(calibration.error().in("the rig's calibration"));
  return calibration;
}

namespace {

/// Adds `sets` sets with a picture of every head. `calibration`: id of the one in force.
Status pull_into(RigPictures& pictures, RigConnection& rig, const std::string& calibration, int sets,
                 Console& console) {
  NODAL_TRY_ASSIGN(const Duration within, patience_for_sets(rig));
  Missed missed(pictures.heads);
  while (pictures.sets.size() < static_cast<std::size_t>(sets)) {
    if (missed.sets() > 0 || !pictures.sets.empty()) {
      NODAL_TRY(rig.rest(kBetweenSets));
    }
    NODAL_TRY_ASSIGN(ReceivedSet set, receive_set(rig, within));
    if (set.header.calibration_id() != calibration) {
      return fail(Errc::kWrongState, "another calibration came into force meanwhile; begin again");
    }
    if (missed.counts(set.header)) {
      if (missed.sets() < kTries) continue;
      return fail(missed.error());
    }
    NODAL_TRY_ASSIGN(std::vector<HeadPicture> all, pictures_of(set, pictures.heads));
    pictures.sets.push_back(std::move(all));
    console.progress(fmt::format("frame set {} of {}", pictures.sets.size(), sets));
    missed = Missed(pictures.heads);
  }
  console.finish_progress();
  return {};
}

}  // namespace

Result<RigPictures> pull_frame_sets(RigConnection& rig, const Calibration& calibration, int sets, Console& console) {
  RigPictures pictures;
  pictures.origin = RigPictures::Origin::kRig;
  pictures.calibration = calibration;
  for (const HeadCalibration& head : calibration.heads) pictures.heads.push_back(head.name);
  const Sha256 id = calibration_id(calibration);
  NODAL_TRY(pull_into(pictures, rig, std::string(id.begin(), id.end()), sets, console));
  return pictures;
}

Result<RigPictures> pull_uncalibrated_set(RigConnection& rig, const std::string& what, Console& console) {
  NODAL_TRY(require_feature(rig, "frame-sets", what));
  wire::Request request;
  request.mutable_heads();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  RigPictures pictures;
  pictures.origin = RigPictures::Origin::kPictures;
  for (const wire::HeadState& head : reply.heads().heads()) pictures.heads.push_back(head.name());
  NODAL_TRY(pull_into(pictures, rig, "", 1, console));
  return pictures;
}

Result<RigPictures> pull_frame_sets(RigConnection& rig, const std::string& what, int sets, Console& console) {
  NODAL_TRY(require_feature(rig, "frame-sets", what));
  NODAL_TRY_ASSIGN(const Calibration calibration, calibration_in_force(rig));
  return pull_frame_sets(rig, calibration, sets, console);
}

}  // namespace nodal::host
