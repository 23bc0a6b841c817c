#include "firmware/record/head_streams.h"

#include <algorithm>
#include <cstring>

#include "firmware/frame/pack_picture.h"
#include "protocol/take/limits.h"
#include "stitch/media/ut_video.h"

namespace nodal::firmware {
namespace {

take::Stream delivered_stream(const hal::FrameView& frame) {
  const ImageView& picture = frame.image;
  return {picture.format, picture.width, picture.height, picture.coding, frame.fields};
}

std::size_t most_bytes_of(const ImageView& picture, const take::Stream& stored) {
  if (stored.lossless) return media::ut_video_most_bytes(stored.format, stored.width, stored.height);
  if (stored.format != PixelFormat::kMjpeg) return packed_size(stored.format, stored.width, stored.height);
  if (picture.format == PixelFormat::kMjpeg) return picture.bytes;
  const std::size_t raw = packed_size(picture.format, picture.width, picture.height);
  return raw + raw / 2;
}

}  // namespace

HeadStreams::HeadStreams(const RigConfig& config) : raymap_format_(config.raymap.format) {
  std::ranges::transform(config.heads, modes_.begin(), &HeadConfig::take_mode);
}

/// Computed when the head's format changes.
HeadStreams::Format& HeadStreams::format_of(const hal::FrameView& frame, std::size_t head) {
  const take::Stream delivered = delivered_stream(frame);
  std::optional<Format>& format = formats_[head];
  if (!format || format->delivered != delivered)
    format.emplace(Format{delivered, stored_stream(delivered, modes_[head], raymap_format_), std::nullopt});
  return *format;
}

bool HeadStreams::follow(const FrameSet& set) {
  bool changed = false;
  for (std::size_t head = 0; head < kMaxHeads; ++head) {
    if (!set.has(head)) continue;
    const take::Stream& stream = format_of(set.frames[head], head).stored;
    if (in_take_[head] == stream) continue;
    if (in_take_[head] && set.mid_exposure - since_[head] < kFormatStays) continue;
    in_take_[head] = stream;
    since_[head] = set.mid_exposure;
    changed = true;
  }
  return changed;
}

std::size_t HeadStreams::most_bytes(const hal::FrameView& frame, std::size_t head) {
  return most_bytes_of(frame.image, format_of(frame, head).stored);
}

bool HeadStreams::store(const hal::FrameView& frame, std::size_t head, int quality, PictureRing& ring,
                        RecordedFrame& to) {
  const ImageView& picture = frame.image;
  Format& format = format_of(frame, head);
  to.placeholder = Placeholder::kFormat;
  std::size_t bytes = most_bytes_of(picture, format.stored);
  if (in_take_[head] != format.stored || bytes > take::kMaxTakePictureBytes) return true;
  HeadCoder::Parts parts{};
  const bool recoded = format.stored != format.delivered;
  if (recoded) {
    if (!format.coder) format.coder.emplace(format.delivered, format.stored);
    if (format.stored.format == PixelFormat::kMjpeg) to.quality = quality;
    const auto coded = format.coder->code(picture, to.quality);
    if (!coded) {
      to.placeholder = Placeholder::kEncoder;
      return true;
    }
    parts = *coded;
    bytes = parts[0].size() + parts[1].size();
  }
  const auto place = ring.take(bytes);
  if (!place) return false;
  if (recoded) std::ranges::copy(parts[1], std::ranges::copy(parts[0], place->begin()).out);
  else if (picture.format == PixelFormat::kMjpeg) std::memcpy(place->data(), picture.planes[0].data, bytes);
  else pack_picture(picture, place->data());
  to.placeholder = Placeholder::kNone;
  to.bytes = *place;
  return true;
}

}  // namespace nodal::firmware
