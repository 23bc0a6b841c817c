#include "stitch/media/take/segment_rules.h"

#include <fmt/format.h>

#include <vector>

#include "protocol/base/try.h"
#include "protocol/take/seam_map.h"
#include "protocol/take/stream.h"
#include "stitch/media/ut_video.h"

namespace nodal::media {
namespace {

Status check_frame(const take::StreamFile& file, const take::wire::Frame& frame, std::uint64_t set) {
  const take::Stream& stream = file.stream;
  const auto wrong = [&](std::uint64_t most) {
    return fail(Errc::kBadFormat, fmt::format("set {}: {} bytes of {} at byte {}; a {} picture of {}x{} has {}", set,
                                              frame.bytes(), file.name, frame.at(), pixel_format_name(stream.format),
                                              stream.width, stream.height, most));
  };
  if (stream.lossless && !ut_video_codes(stream.format, stream.width, stream.height)) {
    return fail(Errc::kBadFormat,
                fmt::format("set {}: {} has pictures of {} {}x{}, which Ut Video does not code", set, file.name,
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
                                             file.name, expected, take::kMaxTakePictureBytes));
  }
  return {};
}

}  // namespace

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
  std::vector<take::StreamFile> files;
  for (const take::wire::File& record : begin.files()) {
    const take::StreamFile& file = files.emplace_back(take::stream_file(record));
    if (!file.head || *file.head < about.heads.size()) continue;
    return fail(Errc::kBadFormat,
                fmt::format("has pictures of head {}, and take.json names {} heads", *file.head, about.heads.size()));
  }
  for (const take::wire::Set& set : segment.sets) {
    for (const take::wire::Frame& frame : set.frames()) {
      NODAL_TRY(check_frame(files[frame.file()], frame, set.index()));
    }
  }
  for (const take::wire::Seams& seams : segment.seams) {
    NODAL_TRY(take::check_seams(seams, about.heads.size()));
  }
  return {};
}

}  // namespace nodal::media
