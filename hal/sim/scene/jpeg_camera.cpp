#include "hal/sim/scene/jpeg_camera.h"

#include <turbojpeg.h>

#include "protocol/base/result.h"

namespace nodal::hal::sim {

constexpr int kQuality = 90;

void JpegCamera::Close::operator()(void* handle) const { tjDestroy(handle); }

JpegCamera::JpegCamera() : handle_(tjInitCompress()) { NODAL_ASSERT(handle_); }

void JpegCamera::encode(const ImageView& picture, std::vector<std::uint8_t>& jpeg) {
  NODAL_ASSERT(picture.format == PixelFormat::kI420);
  std::array<const unsigned char*, kMaxPlanes> planes{};
  std::array<int, kMaxPlanes> strides{};
  for (std::size_t c = 0; c < kMaxPlanes; ++c) {
    planes[c] = picture.planes[c].data;
    strides[c] = static_cast<int>(picture.planes[c].row_stride);
  }
  unsigned long size = tjBufSize(picture.width, picture.height, TJSAMP_420);
  jpeg.resize(size);
  unsigned char* into = jpeg.data();
  const int status = tjCompressFromYUVPlanes(handle_.get(), planes.data(), picture.width, strides.data(),
                                             picture.height, TJSAMP_420, &into, &size, kQuality, TJFLAG_NOREALLOC);
  NODAL_ASSERT(status == 0);
  jpeg.resize(size);
}

}  // namespace nodal::hal::sim
