#include "firmware/picture/jpeg.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <cmath>
#include <optional>

namespace nodal::firmware {
namespace {

struct Segment {
  std::uint8_t marker = 0;
  std::string body;
};

/// The segments before the scan, parsed according to ITU T.81, B.1.1.4; nothing if they are inconsistent.
std::optional<std::vector<Segment>> segments(const std::vector<std::uint8_t>& jpeg) {
  std::vector<Segment> found;
  if (jpeg.size() < 4 || jpeg[0] != 0xff || jpeg[1] != 0xd8) return std::nullopt;
  for (std::size_t at = 2; at + 4 <= jpeg.size();) {
    if (jpeg[at] != 0xff) return std::nullopt;
    const std::size_t length = (std::size_t{jpeg[at + 2]} << 8) | jpeg[at + 3];
    if (length < 2 || at + 2 + length > jpeg.size()) return std::nullopt;
    found.push_back({jpeg[at + 1], std::string(jpeg.begin() + static_cast<std::ptrdiff_t>(at + 4),
                                               jpeg.begin() + static_cast<std::ptrdiff_t>(at + 2 + length))});
    if (found.back().marker == 0xda) return found;
    at += 2 + length;
  }
  return std::nullopt;
}

std::vector<std::uint8_t> decode_rgb(const std::vector<std::uint8_t>& jpeg, int width, int height) {
  std::vector<std::uint8_t> rgb(static_cast<std::size_t>(width * height * 3));
  const tjhandle handle = tjInitDecompress();
  EXPECT_EQ(tjDecompress2(handle, jpeg.data(), jpeg.size(), rgb.data(), width, 0, height, TJPF_RGB, 0), 0)
      << tjGetErrorStr2(handle);
  tjDestroy(handle);
  return rgb;
}

RaymapConfig config_of(PixelFormat format, int width = 256, int height = 128) {
  RaymapConfig config;
  config.width = width;
  config.height = height;
  config.format = format;
  config.jpeg_quality = 95;
  return config;
}

RaymapInfo some_info() {
  RaymapInfo info;
  info.set = 12;
  info.sync.trigger = 34;
  info.heads = 0x3ff;
  info.sync.state = GenlockState::kLocked;
  info.calibration.fill(0xab);
  return info;
}

std::vector<std::uint8_t> encoded(const RaymapConfig& config, const std::vector<std::uint8_t>& pixels) {
  JpegEncoder encoder(config);
  std::vector<std::uint8_t> jpeg;
  EXPECT_TRUE(
      encoder.encode(packed_image(config.format, config.width, config.height, pixels.data()), some_info(), jpeg));
  return jpeg;
}

TEST(Jpeg, ASphere_CarriesGPanoAsViewersReadIt) {
  const RaymapConfig config = config_of(PixelFormat::kRgb24);
  const auto jpeg = encoded(config, std::vector<std::uint8_t>(256 * 128 * 3, 90));
  const auto found = segments(jpeg);
  ASSERT_TRUE(found);
  ASSERT_GE(found->size(), 3u);
  EXPECT_EQ(found->at(0).marker, 0xe0) << "JFIF comes first";
  const Segment& xmp = found->at(1);
  EXPECT_EQ(xmp.marker, 0xe1);
  EXPECT_EQ(xmp.body.substr(0, 29), std::string("http://ns.adobe.com/xap/1.0/\0", 29));
  for (const char* attribute :
       {"xmlns:GPano=\"http://ns.google.com/photos/1.0/panorama/\"", "GPano:ProjectionType=\"equirectangular\"",
        "GPano:UsePanoramaViewer=\"True\"", "GPano:FullPanoWidthPixels=\"256\"", "GPano:FullPanoHeightPixels=\"128\"",
        "GPano:CroppedAreaImageWidthPixels=\"256\"", "GPano:CroppedAreaImageHeightPixels=\"128\"",
        "GPano:CroppedAreaLeftPixels=\"0\"", "GPano:CroppedAreaTopPixels=\"0\"", "<x:xmpmeta ", "</x:xmpmeta>"}) {
    EXPECT_NE(xmp.body.find(attribute), std::string::npos) << attribute;
  }
  EXPECT_EQ(xmp.body.find("Pose"), std::string::npos) << "a rig does not know where north is";
  EXPECT_EQ(found->at(2).marker, 0xfe);
  EXPECT_EQ(found->at(2).body, RaymapComment(some_info()).text());
}

TEST(Jpeg, ItsComment_NamesTheSetItsPulseAndItsCalibration) {
  const std::string comment(RaymapComment(some_info()).text());
  EXPECT_EQ(comment,
            "nodal set=12 mid_exposure_ns=0 spread_ns=0 heads=0x3ff genlock=locked calibration="
            "abababababababababababababababababababababababababababababababab trigger=34");
}

TEST(Jpeg, ACube_IsNoSphereToViewers) {
  RaymapConfig config = config_of(PixelFormat::kRgb24, 96, 64);
  config.layout = "cube";
  const auto jpeg = encoded(config, std::vector<std::uint8_t>(96 * 64 * 3, 90));
  const auto found = segments(jpeg);
  ASSERT_TRUE(found);
  for (const Segment& segment : *found) EXPECT_NE(segment.marker, 0xe1);
}

TEST(Jpeg, Rgb_ComesBackAsItWentIn) {
  const RaymapConfig config = config_of(PixelFormat::kRgb24);
  std::vector<std::uint8_t> pixels(256 * 128 * 3);
  for (std::size_t i = 0; i < 256 * 128; ++i) {
    pixels[3 * i] = static_cast<std::uint8_t>(i % 256);
    pixels[3 * i + 1] = static_cast<std::uint8_t>(i / 256);
    pixels[3 * i + 2] = 77;
  }
  const auto back = decode_rgb(encoded(config, pixels), 256, 128);
  for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_NEAR(back[i], pixels[i], 6) << i;
}

TEST(Jpeg, I420_IsFullRangeBt601) {
  // Y 76, U 85, V 255 is red: R = Y + 1.402 (V-128), G = Y - 0.344 (U-128) - 0.714 (V-128), B = Y + 1.772 (U-128).
  const RaymapConfig config = config_of(PixelFormat::kI420);
  std::vector<std::uint8_t> pixels(256 * 128 * 3 / 2, 76);
  std::fill(pixels.begin() + 256 * 128, pixels.begin() + 256 * 128 * 5 / 4, std::uint8_t{85});
  std::fill(pixels.begin() + 256 * 128 * 5 / 4, pixels.end(), std::uint8_t{255});
  const auto back = decode_rgb(encoded(config, pixels), 256, 128);
  for (std::size_t i = 0; i < back.size(); i += 3) {
    ASSERT_NEAR(back[i], 254, 2);
    ASSERT_NEAR(back[i + 1], 0, 2);
    ASSERT_NEAR(back[i + 2], 0, 2);
  }
}

TEST(Jpeg, Nv12_IsTheSamePictureAsI420) {
  std::vector<std::uint8_t> i420(256 * 128 * 3 / 2);
  std::uint32_t state = 1;
  for (std::uint8_t& value : i420) value = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24);
  std::vector<std::uint8_t> nv12 = i420;
  const std::size_t luma = 256 * 128, chroma = luma / 4;
  for (std::size_t i = 0; i < chroma; ++i) {
    nv12[luma + 2 * i] = i420[luma + i];
    nv12[luma + 2 * i + 1] = i420[luma + chroma + i];
  }
  EXPECT_EQ(encoded(config_of(PixelFormat::kNv12), nv12), encoded(config_of(PixelFormat::kI420), i420));
}

TEST(Jpeg, LinearNumbers_AreShownAsTheirScaleSays) {
  const RaymapConfig config = config_of(PixelFormat::kRgb48);
  RaymapInfo info = some_info();
  info.linear.emplace();
  for (std::size_t level = 1; level < 256; ++level) {  // a square law; white is half of the range
    info.linear->shown_from[level] = static_cast<std::uint16_t>(level * level / 2);
  }
  std::vector<std::uint8_t> numbers(256 * 128 * 6);
  for (std::size_t i = 0; i < 256 * 128; ++i) {
    const std::size_t level = i % 256;
    const std::array<std::size_t, 3> rgb{level * level / 2, 40'000, 100 * 100 / 2 - 1};
    for (std::size_t c = 0; c < 3; ++c) {
      numbers[6 * i + 2 * c] = static_cast<std::uint8_t>(rgb[c]);
      numbers[6 * i + 2 * c + 1] = static_cast<std::uint8_t>(rgb[c] >> 8);
    }
  }
  JpegEncoder encoder(config);
  std::vector<std::uint8_t> jpeg;
  const std::uint8_t* const from = numbers.data();
  ASSERT_TRUE(encoder.encode(packed_image(config.format, 256, 128, from), info, jpeg));
  const auto back = decode_rgb(jpeg, 256, 128);
  for (std::size_t i = 0; i < 256 * 128; ++i) {
    ASSERT_NEAR(back[3 * i], static_cast<int>(i % 256), 6) << i;
    ASSERT_NEAR(back[3 * i + 1], 255, 6);
    ASSERT_NEAR(back[3 * i + 2], 99, 6);
  }
  info.linear->shown_from.fill(65535);  // the exposures change: everything is black
  info.linear->shown_from[0] = 0;
  ASSERT_TRUE(encoder.encode(packed_image(config.format, 256, 128, from), info, jpeg));
  for (const std::uint8_t value : decode_rgb(jpeg, 256, 128)) ASSERT_NEAR(value, 0, 2);
}

TEST(Jpeg, Grey_StaysGrey) {
  const RaymapConfig config = config_of(PixelFormat::kGrey8);
  const auto back = decode_rgb(encoded(config, std::vector<std::uint8_t>(256 * 128, 200)), 256, 128);
  for (const std::uint8_t value : back) ASSERT_NEAR(value, 200, 1);
}

TEST(Jpeg, EncodedAgainIntoTheSameBuffer_IsTheSameBytes) {
  const RaymapConfig config = config_of(PixelFormat::kRgb24);
  JpegEncoder encoder(config);
  std::vector<std::uint8_t> noise(256 * 128 * 3);
  std::uint32_t state = 1;
  for (std::uint8_t& value : noise) value = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24);
  const std::uint8_t* const pixels = noise.data();
  std::vector<std::uint8_t> first;
  ASSERT_TRUE(encoder.encode(packed_image(config.format, 256, 128, pixels), some_info(), first));
  std::vector<std::uint8_t> second(1'000'000, 1);
  ASSERT_TRUE(encoder.encode(packed_image(config.format, 256, 128, pixels), some_info(), second));
  EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace nodal::firmware
