#include "stitch/media/take/segment_rules.h"

#include <fmt/format.h>

#include <vector>

#include "protocol/base/try.h"
#include "protocol/take/seam_map.h"
#include "stitch/media/ut_video.h"

namespace nodal::media {
namespace {

Fields fields_named(std::string_view name) {
  if (name == "top-first") return Fields::kTopFirst;
  return name == "bottom-first" ? Fields::kBottomFirst : Fields::kProgressive;
}

Status check_frame(const TakeStream& stream, const take::wire::Frame& frame, std::uint64_t set) {
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
  const std::uint64_t expected = jpeg              ? take::kMaxTakePictureBytes
                                 : stream.lossless ? ut_video_most_bytes(stream.format, stream.width, stream.height)
                                                   : packed_size(stream.format, stream.width, stream.height);
  if (jpeg || stream.lossless ? frame.bytes() == 0 || frame.bytes() > expected : frame.bytes() != expected)
    return wrong(expected);
  if (expected > take::kMaxTakePictureBytes) {
    return fail(Errc::kTooLarge, fmt::format("set {}: a picture of {} has {} bytes; at most {} are read", set,
                                             stream.file, expected, take::kMaxTakePictureBytes));
  }
  return {};
}

}  // namespace

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
  stream.fields_apart = file.fields_apart();
  return stream;
}

Status check_segment(const take::Segment& segment, std::uint32_t number, const take::TakeDocument& about,
                     SetsBefore before) {
  const take::wire::Begin& begin = segment.begin;
  if (begin.take() != about.number || begin.segment() != number) {
    return fail(Errc::kBadFormat, fmt::format("is of take {}, segment {}", begin.take(), begin.segment()));
  }
  const std::uint64_t next = before.kept + before.deleted;
  if (begin.first_set() < next) {
    return fail(Errc::kBadFormat, fmt::format("begins with set {} where {} comes next", begin.first_set(), next));
  }
  std::vector<TakeStream> streams;
  for (const take::wire::File& file : begin.files()) {
    const TakeStream& stream = streams.emplace_back(stream_of(file));
    if (!stream.head || *stream.head < about.heads.size()) continue;
    return fail(Errc::kBadFormat,
                fmt::format("has pictures of head {}, and take.json names {} heads", *stream.head, about.heads.size()));
  }
  for (const take::wire::Set& set : segment.sets) {
    for (const take::wire::Frame& frame : set.frames()) {
      NODAL_TRY(check_frame(streams[frame.file()], frame, set.index()));
    }
  }
  for (const take::wire::Seams& seams : segment.seams) {
    NODAL_TRY(take::check_seams(seams, about.heads.size()));
  }
  return {};
}

}  // namespace nodal::media
