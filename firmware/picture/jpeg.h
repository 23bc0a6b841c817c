// Encodes raymaps as JPEG files that 360-degree viewers open as a sphere.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/raymap.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// The XMP packet of Google's Photo Sphere metadata (ns.google.com/photos/1.0/panorama) for a whole sphere,
/// 360 x 180 degrees, middle column forward.
std::string gpano_packet(int width, int height);

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

/// Compresses packed raymaps with TurboJPEG (16-bit raymaps are mapped to 8 bits by RaymapInfo::linear) and writes
/// their metadata: GPano in an APP1 segment when the layout is equirectangular, and a RaymapComment.
///
/// Threading: thread-bound.
/// Ownership: owns a scratch buffer with the size of the largest possible JPEG of a raymap.
/// Errors: kInternal with TurboJPEG's message.
class JpegEncoder {
 public:
  explicit JpegEncoder(const RaymapConfig& config);
  ~JpegEncoder();
  JpegEncoder(const JpegEncoder&) = delete;
  JpegEncoder& operator=(const JpegEncoder&) = delete;

  /// Replaces the contents of `into`. The vector keeps its capacity, so that the steady state allocates nothing.
  Status encode(const ImageView& raymap, const RaymapInfo& info, std::vector<std::uint8_t>& into);

 private:
  /// The raymap in a format that TurboJPEG accepts: the raymap itself, or a conversion in picture_.
  ImageView codable(const ImageView& raymap, const RaymapInfo& info);
  void set_levels(const blend::LinearScale& scale);
  Result<std::size_t> compress(const ImageView& raymap);

  const RaymapConfig config_;
  const PixelFormat coded_;                      ///< format that is compressed
  std::vector<std::uint8_t> picture_;            ///< converted picture; empty if raymaps are in coded_ already
  std::vector<std::uint8_t> level_of_;           ///< lookup table: 16-bit value to 8-bit level
  std::array<std::uint16_t, 256> shown_from_{};  ///< the scale that level_of_ was computed from
  void* handle_;
  std::vector<std::uint8_t> gpano_;          ///< the whole APP1 segment; empty for other layouts
  std::unique_ptr<std::uint8_t[]> scratch_;  ///< not cleared, so that unused pages need no memory
  std::size_t scratch_bytes_ = 0;
};

}  // namespace nodal::firmware
