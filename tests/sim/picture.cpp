#include "tests/sim/picture.h"

#include <algorithm>
#include <array>

#include "hal/sim/scene/jpeg_camera.h"
#include "tests/sim/stamp.h"

namespace nodal::swarm {
namespace {

constexpr std::uint8_t kNeutral = 128;
/// kPictureLevel in video range, 16 + 100 x 219 / 255, rounded.
constexpr std::uint8_t kVideoLevel = 102;

std::vector<std::uint8_t> jpeg_with_comment() {
  const std::vector<std::uint8_t> picture = grey_picture(PixelFormat::kI420, {});
  std::vector<std::uint8_t> jpeg;
  hal::sim::JpegCamera().encode(picture_view(PixelFormat::kI420, picture), jpeg);
  constexpr std::uint8_t kLength = 2 + sizeof(Stamp);
  std::array<std::uint8_t, 4 + sizeof(Stamp)> comment{0xff, 0xfe, 0, kLength};
  jpeg.insert(jpeg.begin() + 2, comment.begin(), comment.end());
  return jpeg;
}

template <class Byte>
BasicImageView<Byte> view_of(PixelFormat format, std::span<Byte> picture) {
  if (format != PixelFormat::kMjpeg) return packed_image(format, kPictureWidth, kPictureHeight, picture.data());
  BasicImageView<Byte> view{format, kPictureWidth, kPictureHeight, {}, picture.size()};
  view.planes[0] = {picture.data(), static_cast<int>(picture.size()), 1, static_cast<std::ptrdiff_t>(picture.size())};
  return view;
}

}  // namespace

std::vector<std::uint8_t> grey_picture(PixelFormat format, const ColourCoding& coding) {
  if (format == PixelFormat::kMjpeg) return jpeg_with_comment();
  const std::uint8_t luma = coding.video_range ? kVideoLevel : kPictureLevel;
  std::vector<std::uint8_t> picture(packed_size(format, kPictureWidth, kPictureHeight), luma);
  if (format == PixelFormat::kYuv411) {  // U Y Y V Y Y
    for (std::size_t i = 0; i < picture.size(); i += 3) picture[i] = kNeutral;
    return picture;
  }
  if (!has_chroma(format)) return picture;
  const MutableImageView view = writable_view(format, picture);
  for (int c = 1; c < kMaxPlanes; ++c) {
    const MutablePlaneView& plane = view.planes[static_cast<std::size_t>(c)];
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) plane.data[y * plane.row_stride + x * plane.pixel_stride] = kNeutral;
    }
  }
  return picture;
}

ImageView picture_view(PixelFormat format, std::span<const std::uint8_t> picture) { return view_of(format, picture); }
MutableImageView writable_view(PixelFormat format, std::span<std::uint8_t> picture) { return view_of(format, picture); }

bool is_cut(const ImageView& picture) {
  return picture.format == PixelFormat::kMjpeg && picture.bytes < static_cast<std::size_t>(picture.planes[0].width);
}

}  // namespace nodal::swarm
