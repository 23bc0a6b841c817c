#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"
#include "protocol/base/try.h"
#include "stitch/media/take/take_folder.h"
#include "stitch/media/ut_video.h"

namespace nodal::media {
namespace {

TakeFrame frame_of(const take::wire::Frame& stored, const take::Stream& stream) {
  TakeFrame frame;
  frame.present = stored.placeholder() != "missing";
  frame.placeholder = stored.placeholder();
  frame.fields = stream.fields;
  if (!frame.present) return frame;
  frame.offset = Duration::nanoseconds(stored.offset_ns());
  constexpr std::uint64_t kLongest = 1'000'000'000'000;  // ns
  frame.exposure =
      Exposure::of(Duration::nanoseconds(static_cast<std::int64_t>(std::min(stored.exposure_ns(), kLongest))));
  frame.gain = Gain::millidecibels(std::clamp(stored.gain_mdb(), -kMaxGainMdb, kMaxGainMdb));
  const auto q12 = [](std::uint32_t value) {
    return static_cast<std::uint16_t>(std::min<std::uint32_t>(value, 65535));
  };
  frame.white_balance = {q12(stored.red_q12()), q12(stored.blue_q12())};
  frame.gamma = static_cast<std::int32_t>(std::min<std::uint32_t>(stored.gamma(), 100'000));
  frame.sequence = stored.sequence();
  return frame;
}

ImageView view_of(const take::Stream& stream, const std::vector<std::uint8_t>& bytes) {
  ImageView view{stream.format, stream.width, stream.height, {}, bytes.size(), stream.coding};
  if (stream.format == PixelFormat::kMjpeg) {
    const int length = static_cast<int>(bytes.size());
    view.planes[0] = {bytes.data(), length, 1, length, 1};
    return view;
  }
  view.planes = packed_image(stream.format, stream.width, stream.height, bytes.data()).planes;
  return view;
}

}  // namespace

Result<bool> TakeSets::next(TakeSet& set) {
  while (!segment_ || next_set_ == segment_->evidence().sets.size()) {
    if (next_segment_ == folder_.segments()) return false;
    const SetsBefore before = segment_ ? segment_->after() : SetsBefore();
    segment_.reset();
    NODAL_TRY_ASSIGN(auto opened, folder_.segment(next_segment_++, before));
    segment_.emplace(std::move(opened));
    next_set_ = 0;
  }
  const take::wire::Set& stored = segment_->evidence().sets[next_set_++];
  set.evidence = stored;
  set.mid_exposure = Instant::from_ns(stored.mid_exposure_ns());
  set.heads = {};
  for (const take::wire::Frame& frame : stored.frames()) {
    const take::StreamFile& file = segment_->streams()[frame.file()];
    set.heads[*file.head] = frame_of(frame, file.stream);
  }
  return true;
}

Status TakeSets::go_to(const Place& place) {
  if (!segment_ || next_segment_ != place.segment + 1) {
    segment_.reset();
    NODAL_TRY_ASSIGN(auto opened, folder_.segment(place.segment, place.before));
    segment_.emplace(std::move(opened));
    next_segment_ = place.segment + 1;
  }
  next_set_ = place.set;
  return {};
}

Status TakeSets::read_pictures(TakeSet& set) {
  for (std::size_t head = 0; head < set.heads.size(); ++head) {
    NODAL_TRY(read_picture(set, head));
  }
  return {};
}

Status TakeSets::read_picture(TakeSet& set, std::size_t head) {
  for (const take::wire::Frame& frame : set.evidence.frames()) {
    const take::StreamFile& file = segment_->streams()[frame.file()];
    if (file.head != head || !set.heads[head].placeholder.empty()) continue;
    std::vector<std::uint8_t>& bytes = set.bytes[head];
    NODAL_TRY(segment_->read(frame.file(), frame.at(), frame.bytes(), bytes));
    const take::Stream& stream = file.stream;
    if (stream.lossless) {
      std::vector<std::uint8_t> picture;
      const Status decoded = decode_ut_video(bytes, stream.format, stream.width, stream.height, picture);
      if (!decoded) return fail(decoded.error().in(folder_.shown(file.name)));
      bytes.swap(picture);
    }
    set.heads[head].image = view_of(stream, bytes);
  }
  return {};
}

}  // namespace nodal::media
