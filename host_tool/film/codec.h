// Codecs of the films that are written: ffmpeg's encoders with settings that give the same bytes on every run.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_tool/film/programs.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::film {

enum class Codec : std::uint8_t { kH264, kH265, kProres, kFfv1, kMpeg2 };
enum class Container : std::uint8_t { kMp4, kMov, kMkv };

std::string_view name_of(Codec codec);
std::optional<Codec> codec_named(std::string_view name);
/// By the name's ending; nothing for another one.
std::optional<Container> container_of(std::string_view path);

/// What decides the coded bytes, besides the pictures.
struct Coding {
  Codec codec = Codec::kH264;
  int width = 0;
  int height = 0;
  PixelFormat format = PixelFormat::kI420;  ///< the raymaps' format
  FrameRate rate;
  int quality = -1;      ///< constant rate factor of H.264 and H.265, 0 (best) to 51; -1: the codec's usual one
  std::string preset;    ///< x264's and x265's; empty: medium
  std::string transfer;  ///< how light follows from the numbers, as the heads' films say; empty: BT.709
  friend bool operator==(const Coding& a, const Coding& b) {
    return a.codec == b.codec && a.width == b.width && a.height == b.height && a.format == b.format &&
           a.rate.numerator == b.rate.numerator && a.rate.denominator == b.rate.denominator && a.quality == b.quality &&
           a.preset == b.preset && a.transfer == b.transfer;
  }
};

/// The codec of a film when the user names none: by the container and the width.
Codec usual_codec(Container container, int width);

/// Whether the codec can do it, the container holds it and ffmpeg has the encoder. Before work starts.
/// Errors: kUnsupported, with what to choose instead.
Status check(const Coding& coding, Container container, const Programs& programs);

/// ffmpeg's words for raw pictures from standard input, coded to `out`, a film of whole groups of pictures.
std::vector<std::string> encoder_words(const Coding& coding, const std::string& out);
/// The ending of segments, which hold the codec with exact times: ".mp4", ".mov".
std::string_view segment_ending(Codec codec);

}  // namespace nodal::film
