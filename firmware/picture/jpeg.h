// Raymaps as JPEG files that 360-degree viewers open as a sphere.
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

/// What the comment of a raymap's JPEG says: "nodal set=12 calibration=<64 hex digits> heads=0x3ff ...".
/// Made for every raymap, so it allocates nothing.
class RaymapComment {
 public:
  explicit RaymapComment(const RaymapInfo& info);
  std::string_view text() const { return {text_.data(), length_}; }

 private:
  void add(const char* format, ...) __attribute__((format(printf, 2, 3)));

  std::array<char, 320> text_{};
  std::size_t length_ = 0;
};

/// Compresses packed raymaps with TurboJPEG (those of 16 bits as RaymapInfo::linear shows them in 8) and writes
/// their metadata: GPano in an APP1 segment when the layout is equirectangular, and a RaymapComment.
///
/// Threading: thread-bound.
/// Ownership: keeps a scratch buffer of the largest JPEG a raymap can become.
/// Errors: kInternal with TurboJPEG's words.
class JpegEncoder {
 public:
  explicit JpegEncoder(const RaymapConfig& config);
  ~JpegEncoder();
  JpegEncoder(const JpegEncoder&) = delete;
  JpegEncoder& operator=(const JpegEncoder&) = delete;

  /// Replaces what is in `into`; it keeps its capacity, so that in the long run nothing is allocated.
  Status encode(const ImageView& raymap, const RaymapInfo& info, std::vector<std::uint8_t>& into);

 private:
  /// The raymap in a format that TurboJPEG takes, where it lies or in picture_.
  ImageView codable(const ImageView& raymap, const RaymapInfo& info);
  void set_levels(const blend::LinearScale& scale);
  Result<std::size_t> compress(const ImageView& raymap);

  const RaymapConfig config_;
  const PixelFormat coded_;                      ///< what is compressed
  std::vector<std::uint8_t> picture_;            ///< in that; empty where it is what comes
  std::vector<std::uint8_t> level_of_;           ///< by number of 16 bits
  std::array<std::uint16_t, 256> shown_from_{};  ///< that level_of_ was made of
  void* handle_;
  std::vector<std::uint8_t> gpano_;          ///< the whole APP1 segment; empty for other layouts
  std::unique_ptr<std::uint8_t[]> scratch_;  ///< not cleared: pages that no JPEG reaches stay unused
  std::size_t scratch_bytes_ = 0;
};

}  // namespace nodal::firmware
