#include "firmware/record/segment_track.h"

#include <utility>

#include "firmware/record/segment_writer.h"
#include "protocol/base/raymap_rate.h"
#include "protocol/base/try.h"
#include "stitch/decode/jpeg_frame.h"
#include "stitch/media/gpano.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/media/take/take_track.h"
#include "stitch/media/ut_video.h"

namespace nodal::firmware {

bool fields_apart(const take::Stream& stream, const TakeRow& first, std::size_t head) {
  if (stream.format != PixelFormat::kMjpeg || stream.fields == Fields::kProgressive) return false;
  for (const RecordedSet& set : first.sets) {
    if (!set.frames[head].bytes.empty())
      return decode::first_field_of(set.frames[head].bytes) == first_field(stream.fields);
  }
  return true;
}

Result<std::vector<std::uint8_t>> grey_picture(const take::Stream& stream) {
  const PixelFormat format = stream.format == PixelFormat::kMjpeg ? PixelFormat::kI420 : stream.format;
  std::vector<std::uint8_t> grey(packed_size(format, stream.width, stream.height), 128);
  if (stream.lossless) {
    std::vector<std::uint8_t> coded;
    media::UtVideoEncoder().encode(packed_image(format, stream.width, stream.height, std::as_const(grey).data()),
                                   coded);
    return coded;
  }
  if (stream.format != PixelFormat::kMjpeg) return grey;
  media::JpegWriter writer({.format = format, .width = stream.width, .height = stream.height, .quality = 50});
  std::vector<std::uint8_t> jpeg;
  NODAL_TRY(writer.write(packed_image(format, stream.width, stream.height, std::as_const(grey).data()),
                         "a placeholder: the head has no picture here", jpeg));
  return jpeg;
}

take::VideoTrack SegmentWriter::track_of(const File& file) const {
  take::VideoTrack track = media::track_of(file.about.stream);
  track.rate = tally_.rate();
  if (!file.about.head) track.rate = raymap_rate(tally_.rate(), place_.raymaps_a_set);
  track.fields_apart = file.about.fields_apart;
  if (place_.utc_offset_ns && first_exposure_) {
    const std::int64_t utc = *place_.utc_offset_ns + first_exposure_->ns();
    if (utc >= 0) track.utc_ns = utc;
  }
  track.equirectangular = !file.about.head && media::is_whole_sphere(place_.layout);
  track.writer = place_.software;
  if (!place_.calibration_json.empty()) {
    track.attachments.push_back({take::kCalibrationFile, "application/json", place_.calibration_json});
  }
  return track;
}

}  // namespace nodal::firmware
