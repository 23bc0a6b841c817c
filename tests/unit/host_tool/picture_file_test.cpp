#include "host_tool/picture_file.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

namespace nodal::host {
namespace {

ReceivedRaymap raymap_of(const std::string& coding, std::uint32_t width, std::uint32_t height,
                         std::vector<std::uint8_t> bytes) {
  ReceivedRaymap raymap;
  raymap.header.set_set(42);
  raymap.header.set_coding(coding);
  raymap.header.set_width(width);
  raymap.header.set_height(height);
  raymap.header.set_layout("equirectangular");
  raymap.bytes = std::move(bytes);
  return raymap;
}

/// The pixels as libpng's simplified reader gives them: RGB.
std::vector<std::uint8_t> read_png(const std::vector<std::uint8_t>& png) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&image, png.data(), png.size()), 0);
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0);
  return pixels;
}

TEST(EncodePng, FullRangePrimaries_ComeBackAsTheirRgb) {
  // JFIF's matrix, by hand: red is Y 76, Cb 85, Cr 255; blue is Y 29, Cb 255, Cr 107.
  const struct {
    std::uint8_t y, u, v;
    int r, g, b;
  } colours[] = {{76, 85, 255, 254, 0, 0}, {29, 255, 107, 0, 0, 254}, {255, 128, 128, 255, 255, 255},
                 {0, 128, 128, 0, 0, 0},   {128, 128, 128, 128, 128, 128}};
  for (const auto& colour : colours) {
    std::vector<std::uint8_t> bytes(8 * 4, colour.y);
    bytes.insert(bytes.end(), 4 * 2, colour.u);
    bytes.insert(bytes.end(), 4 * 2, colour.v);
    const auto png = encode_png(raymap_of("I420", 8, 4, bytes));
    ASSERT_TRUE(png) << png.error().text();
    const std::vector<std::uint8_t> rgb = read_png(*png);
    ASSERT_EQ(rgb.size(), 8U * 4 * 3);
    for (std::size_t i = 0; i < rgb.size(); i += 3) {
      EXPECT_NEAR(rgb[i], colour.r, 2);
      EXPECT_NEAR(rgb[i + 1], colour.g, 2);
      EXPECT_NEAR(rgb[i + 2], colour.b, 2);
    }
  }
}

TEST(EncodePng, RgbAndGrey_AreKeptToTheByte) {
  std::vector<std::uint8_t> rgb(4 * 2 * 3);
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<std::uint8_t>(i * 9);
  EXPECT_EQ(read_png(*encode_png(raymap_of("RGB24", 4, 2, rgb))), rgb);
  const auto grey = read_png(*encode_png(raymap_of("GREY", 4, 2, {0, 10, 20, 30, 40, 50, 60, 255})));
  EXPECT_EQ(grey[3], 10);
  EXPECT_EQ(grey[23], 255);
}

TEST(EncodePng, EquirectangularRaymap_CarriesGPanoThatViewersSearchFor) {
  const auto png = encode_png(raymap_of("GREY", 4, 2, std::vector<std::uint8_t>(8)));
  const std::string text(png->begin(), png->end());
  EXPECT_NE(text.find("GPano:ProjectionType=\"equirectangular\""), std::string::npos);
  EXPECT_NE(text.find("GPano:FullPanoWidthPixels=\"4\""), std::string::npos);
  EXPECT_LT(text.find("<x:xmpmeta"), text.find("</x:xmpmeta>"));
}

TEST(CheckRaymap, TornOrStrangeBytes_AreRefusedWithTheSet) {
  const std::vector<std::uint8_t> jpeg{0xFF, 0xD8, 1, 2, 0xFF, 0xD9};
  EXPECT_TRUE(check_raymap(raymap_of("jpeg", 4, 2, jpeg)));
  EXPECT_TRUE(check_raymap(raymap_of("I420", 4, 2, std::vector<std::uint8_t>(12))));
  const struct {
    ReceivedRaymap raymap;
    Errc code;
  } bad[] = {{raymap_of("jpeg", 4, 2, {0xFF, 0xD8, 1, 2, 3}), Errc::kTruncated},
             {raymap_of("jpeg", 4, 2, {}), Errc::kBadFormat},
             {raymap_of("jpeg", 4, 2, {1, 2, 3, 4, 0xFF, 0xD9}), Errc::kBadFormat},
             {raymap_of("I420", 4, 2, std::vector<std::uint8_t>(11)), Errc::kTruncated},
             {raymap_of("I420", 0, 2, {}), Errc::kBadFormat},
             {raymap_of("I420", 4'000'000'000U, 2, {}), Errc::kBadFormat},
             {raymap_of("h266", 4, 2, {}), Errc::kUnsupported}};
  for (const auto& [raymap, code] : bad) {
    const Status status = check_raymap(raymap);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, code) << status.error().text();
    EXPECT_NE(status.error().message.find("set 42"), std::string::npos);
  }
}

TEST(RawSidecar, I420_SaysWhereEveryPlaneLies) {
  const auto json = nlohmann::json::parse(raw_sidecar(raymap_of("I420", 8, 4, std::vector<std::uint8_t>(48))));
  EXPECT_EQ(json["set"], 42);
  EXPECT_EQ(json["range"], "full");
  ASSERT_EQ(json["planes"].size(), 3U);
  EXPECT_EQ(json["planes"][1]["offset"], 32);
  EXPECT_EQ(json["planes"][1]["width"], 4);
  EXPECT_EQ(json["planes"][2]["offset"], 40);
  EXPECT_EQ(json["planes"][2]["component"], "V");
}

TEST(RaymapFormat, ByNameAndByFile) {
  EXPECT_EQ(*raymap_format_of_name("a/b.jpg"), RaymapFormat::kJpg);
  EXPECT_EQ(*raymap_format_of_name("b-%06d.png"), RaymapFormat::kPng);
  EXPECT_EQ(*raymap_format_of_name("b.yuv"), RaymapFormat::kRaw);
  EXPECT_FALSE(raymap_format_of_name("b.tiff"));
  EXPECT_FALSE(parse_raymap_format("JPG"));
}

}  // namespace
}  // namespace nodal::host
