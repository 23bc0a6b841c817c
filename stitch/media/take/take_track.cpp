#include "stitch/media/take/take_track.h"

#include "stitch/media/ut_video.h"

namespace nodal::media {

take::VideoTrack track_of(const take::Stream& stream) {
  take::VideoTrack track;
  track.codec = stream.format == PixelFormat::kMjpeg ? "V_MJPEG" : "V_UNCOMPRESSED";
  track.fourcc = take::fourcc_of(stream.format);
  if (stream.lossless) {
    track.codec = kUtVideoCodec;
    track.fourcc.clear();
    track.codec_private = ut_video_private(stream.format, stream.width, stream.height, stream.coding, stream.fields);
  }
  track.width = stream.width;
  track.height = stream.height;
  track.fields = stream.fields;
  track.coding = stream.coding;
  return track;
}

}  // namespace nodal::media
