// Encodes raymaps as JPEG files that 360-degree viewers open as a sphere.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/raymap.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "stitch/sets/shown_raymap.h"

namespace nodal::media {
class JpegWriter;
}

namespace nodal::firmware {

/// The comment in a raymap's JPEG: "nodal set=12 calibration=<64 hex digits> heads=0x3ff ...".
/// It is made for every raymap, so it allocates nothing.
class RaymapComment {
 public:
  explicit RaymapComment(const RaymapInfo& info);
  std::string_view text() const { return {text_.data(), length_}; }

 private:
  void add(const char* format, ...) __attribute__((format(printf, 2, 3)));

  std::array<char, 320> text_{};
  std::size_t length_ = 0;
};

/// Compresses packed raymaps (16-bit raymaps are mapped to 8 bits by RaymapInfo::linear) and writes their metadata:
/// GPano when the layout is equirectangular, and a RaymapComment.
///
/// Threading: thread-bound.
/// Ownership: owns the scratch memory of one JPEG.
/// Errors: those of media::JpegWriter.
class JpegEncoder {
 public:
  explicit JpegEncoder(const RaymapConfig& config);
  ~JpegEncoder();

  /// Replaces the contents of `into`. The vector keeps its capacity, so that the steady state allocates nothing.
  Status encode(const ImageView& raymap, const RaymapInfo& info, std::vector<std::uint8_t>& into);

 private:
  const RaymapConfig config_;
  sets::ShownRaymap shown_;
  std::unique_ptr<media::JpegWriter> writer_;
};

}  // namespace nodal::firmware
