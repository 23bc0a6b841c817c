#include "host_tool/film/codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "protocol/base/file_ending.h"

namespace nodal::film {
namespace {

struct Known {
  Codec codec;
  std::string_view name;
  std::string_view encoder;
  std::string_view segments;
};
constexpr std::array kKnown{
    Known{Codec::kH264, "h264", "libx264", ".mp4"}, Known{Codec::kH265, "h265", "libx265", ".mp4"},
    Known{Codec::kProres, "prores", "prores_ks", ".mov"}, Known{Codec::kFfv1, "ffv1", "ffv1", ".mov"},
    Known{Codec::kMpeg2, "mpeg2", "mpeg2video", ".mp4"}};

const Known& known(Codec codec) { return *std::ranges::find(kKnown, codec, &Known::codec); }

/// Rates of MPEG-2 (ISO/IEC 13818-2, table 6-4).
bool is_mpeg2_rate(FrameRate rate) {
  constexpr std::array kRates{FrameRate{24000, 1001}, FrameRate{24, 1}, FrameRate{25, 1},       FrameRate{30000, 1001},
                              FrameRate{30, 1},       FrameRate{50, 1}, FrameRate{60000, 1001}, FrameRate{60, 1}};
  return std::ranges::any_of(kRates, [&](FrameRate known) {
    return known.numerator == rate.numerator && known.denominator == rate.denominator;
  });
}

std::string_view raw_name(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey8: return "gray";
    case PixelFormat::kRgb24: return "rgb24";
    default: return "yuv420p";
  }
}

/// Raymaps are Y U V of BT.601 in full range. H.264, H.265 and FFV1 keep them so and say so; the others are for devices
/// that expect BT.709 in video range.
std::string filters(const Coding& coding) {
  const std::string light =
      fmt::format("color_primaries=bt709:color_trc={}", coding.transfer.empty() ? "bt709" : coding.transfer);
  const bool rgb = coding.format == PixelFormat::kRgb24;
  switch (coding.codec) {
    case Codec::kFfv1:
      if (rgb) return fmt::format("setparams=range=pc:{}", light);
      return fmt::format("setparams=range=pc:colorspace=smpte170m:{}", light);
    case Codec::kH264:
    case Codec::kH265: {
      const std::string to = rgb || coding.format == PixelFormat::kGrey8
                                 ? "scale=out_color_matrix=bt601:out_range=pc:flags=accurate_rnd,format=yuv420p,"
                                 : "";
      const std::string from = coding.format == PixelFormat::kGrey8 ? "setparams=range=pc," : "";
      return fmt::format("{}{}setparams=range=pc:colorspace=smpte170m:{}", from, to, light);
    }
    case Codec::kProres:
    case Codec::kMpeg2: break;
  }
  return fmt::format(
      "setparams=range=pc{},scale=in_range=pc:in_color_matrix=bt601:out_range=tv:out_color_matrix=bt709:"
      "flags=accurate_rnd,format={},setparams=range=tv:colorspace=bt709:{}",
      rgb ? "" : ":colorspace=smpte170m", coding.codec == Codec::kProres ? "yuv422p10le" : "yuv420p", light);
}

/// The paper's films: 15 Mbit/s at a constant rate. Small pictures cannot be stuffed so far.
std::vector<std::string> mpeg2_settings(const Coding& coding) {
  constexpr int kStuffed = 1024 * 512;  // px
  std::vector<std::string> words{"-b:v", "15M", "-maxrate", "15M", "-bufsize", "9781248", "-g", "15", "-threads", "1"};
  if (coding.width * coding.height >= kStuffed) words.insert(words.end(), {"-minrate", "15M"});
  return words;
}

/// Numbers of threads are fixed, because the bytes depend on them.
std::vector<std::string> settings(const Coding& coding) {
  const int group = std::max(1, static_cast<int>(2 * coding.rate.numerator / coding.rate.denominator));
  const std::string preset = coding.preset.empty() ? "medium" : coding.preset;
  const auto quality = [&](int usual) { return std::to_string(coding.quality >= 0 ? coding.quality : usual); };
  switch (coding.codec) {
    case Codec::kH264: return {"-preset", preset, "-crf", quality(20), "-g", std::to_string(group), "-threads", "4"};
    case Codec::kH265:
      return {"-preset",      preset,
              "-crf",         quality(23),
              "-tag:v",       "hvc1",
              "-x265-params", fmt::format("log-level=error:pools=2:frame-threads=1:wpp=0:open-gop=0:keyint={}", group)};
    case Codec::kProres: return {"-profile:v", "3", "-vendor", "apl0", "-threads", "4"};
    case Codec::kFfv1: return {"-level", "3", "-g", "1", "-slices", "4", "-slicecrc", "1", "-threads", "4"};
    case Codec::kMpeg2: return mpeg2_settings(coding);
  }
  return {};
}

}  // namespace

std::string_view name_of(Codec codec) { return known(codec).name; }

std::optional<Codec> codec_named(std::string_view name) {
  const auto* const found = std::ranges::find(kKnown, name, &Known::name);
  if (found == kKnown.end()) return std::nullopt;
  return found->codec;
}

std::optional<Container> container_of(std::string_view path) {
  if (has_ending(path, ".mp4")) return Container::kMp4;
  if (has_ending(path, ".mov")) return Container::kMov;
  if (has_ending(path, ".mkv")) return Container::kMkv;
  return std::nullopt;
}

Codec usual_codec(Container, int width) {
  constexpr int kWidestH264 = 4096;  // wider ones are beyond the levels that players decode
  return width > kWidestH264 ? Codec::kH265 : Codec::kH264;
}

Status check(const Coding& coding, Container container, const Programs& programs) {
  const Known& entry = known(coding.codec);
  if (container == Container::kMp4 && (coding.codec == Codec::kProres || coding.codec == Codec::kFfv1)) {
    return fail(Errc::kUnsupported, fmt::format("--codec {}: players do not expect it in an .mp4; let --out end in "
                                                "{}",
                                                entry.name, coding.codec == Codec::kProres ? ".mov" : ".mkv"));
  }
  if (!programs.encoders.contains(entry.encoder)) {
    std::vector<std::string> others;
    for (const Known& other : kKnown) {
      if (programs.encoders.contains(other.encoder)) others.emplace_back(other.name);
    }
    std::string list;
    for (const std::string& other : others) list += (list.empty() ? "" : ", ") + other;
    return fail(Errc::kUnsupported,
                fmt::format("--codec {}: {} has no encoder {}; install Debian's ffmpeg{}", entry.name, programs.ffmpeg,
                            entry.encoder, list.empty() ? "" : fmt::format(", or choose --codec {}", list)));
  }
  const bool subsampled = coding.codec != Codec::kFfv1 || has_chroma(coding.format);
  if (subsampled && (coding.width % 2 != 0 || coding.height % 2 != 0)) {
    return fail(Errc::kUnsupported, fmt::format("--codec {}: a film of {}x{} pixels cannot be coded; choose an even "
                                                "--width and height",
                                                entry.name, coding.width, coding.height));
  }
  if (coding.codec == Codec::kMpeg2 && !is_mpeg2_rate(coding.rate)) {
    return fail(Errc::kUnsupported, fmt::format("--codec mpeg2: it has no rate of {:.3f} frames a second; choose "
                                                "another codec",
                                                static_cast<double>(coding.rate.numerator) / coding.rate.denominator));
  }
  return {};
}

std::vector<std::string> encoder_words(const Coding& coding, const std::string& out) {
  std::vector<std::string> words{"-hide_banner",
                                 "-nostats",
                                 "-v",
                                 "error",
                                 "-nostdin",
                                 "-protocol_whitelist",
                                 "file,pipe",
                                 "-f",
                                 "rawvideo",
                                 "-pix_fmt",
                                 std::string(raw_name(coding.format)),
                                 "-video_size",
                                 fmt::format("{}x{}", coding.width, coding.height),
                                 "-framerate",
                                 fmt::format("{}/{}", coding.rate.numerator, coding.rate.denominator),
                                 "-i",
                                 "pipe:0",
                                 "-vf",
                                 filters(coding),
                                 "-c:v",
                                 std::string(known(coding.codec).encoder)};
  const std::vector<std::string> own = settings(coding);
  words.insert(words.end(), own.begin(), own.end());
  words.insert(words.end(), {"-fflags", "+bitexact", "-flags:v", "+bitexact", "-f",
                             std::string(known(coding.codec).segments.substr(1)), "-y", file_url(out)});
  return words;
}

std::string_view segment_ending(Codec codec) { return known(codec).segments; }

}  // namespace nodal::film
