#include "hal/sim/head_picture.h"

#include <algorithm>
#include <utility>

#include "hal/sim/scene/random.h"

namespace nodal::hal::sim {

HeadPicture::HeadPicture(const HeadCalibration& truth, const HeadOptions& options, ScenePtr scene, std::uint64_t seed)
    : truth_(truth),
      pixels_(options.pixels),
      seed_(seed),
      sensor_(truth, sensor_options(options), std::move(scene), seed),
      jpeg_camera_(pixels_ == PixelFormat::kMjpeg ? std::make_unique<JpegCamera>() : nullptr) {}

FrameView HeadPicture::render(const ExposedFrame& frame, BufferContent& content) {
  std::vector<std::uint8_t>& bytes = content.bytes;
  FrameView view;
  view.sequence = frame.sequence;
  view.mid_exposure = frame.said_mid;
  view.received = frame.received;
  view.in_effect = frame.settings;
  view.nudged = frame.nudged;
  view.verdict = frame.verdict;
  view.fields = frame.fields;
  if (frame.verdict == FrameVerdict::kNoSignal) {
    std::fill(bytes.begin(), bytes.end(), std::uint8_t{128});
    content.holds = 0;
  } else {
    sensor_.set_light(frame.light);
    content.holds = sensor_.render(frame.settings, frame.mid, frame.sequence, bytes, content.holds, frame.fields);
  }
  std::vector<std::uint8_t>* delivered = &bytes;
  if (jpeg_camera_) {
    delivered = &content.jpeg;
    const ImageView picture =
        packed_image(PixelFormat::kI420, truth_.width, truth_.height, std::as_const(bytes).data());
    jpeg_camera_->encode(picture, content.jpeg);
    const auto length = static_cast<int>(content.jpeg.size());
    view.image = {PixelFormat::kMjpeg, truth_.width, truth_.height, {}, content.jpeg.size()};
    view.image.planes[0] = {content.jpeg.data(), length, 1, length, 1};
  } else {
    view.image = packed_image(pixels_, truth_.width, truth_.height, std::as_const(bytes).data());
  }
  if (frame.verdict == FrameVerdict::kTorn) {
    // The transfer ended early: the rest of the buffer keeps its old content, here nothing.
    view.image.bytes = delivered->size() / 2;
    std::fill(delivered->begin() + static_cast<std::ptrdiff_t>(view.image.bytes), delivered->end(), std::uint8_t{0});
    content.holds = 0;
  }
  if (frame.verdict == FrameVerdict::kCorrupt || frame.spoiled) {
    Random garbage(seed_ + frame.sequence, "garbage");
    for (std::size_t i = delivered->size() / 3; i < delivered->size() / 3 * 2; ++i) {
      (*delivered)[i] = static_cast<std::uint8_t>(garbage.next());
    }
    content.holds = 0;
  }
  return view;
}

}  // namespace nodal::hal::sim
