// A camera's JPEG encoder.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "protocol/base/image.h"

namespace nodal::hal::sim {

/// Encodes as cameras do: baseline, 4:2:0, quality 90 of libjpeg-turbo.
///
/// Threading: thread-bound. Ownership: owns its encoder. Errors: none.
class JpegCamera {
 public:
  JpegCamera();
  /// `picture` is I420.
  void encode(const ImageView& picture, std::vector<std::uint8_t>& jpeg);

 private:
  struct Close {
    void operator()(void* handle) const;
  };
  std::unique_ptr<void, Close> handle_;
};

}  // namespace nodal::hal::sim
