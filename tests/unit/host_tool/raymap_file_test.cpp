#include "host_tool/rig/received_raymap.h"

#include <gtest/gtest.h>
#include <png.h>
#include <tiffio.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "protocol/nodal.pb.h"
#include "stitch/media/raymap/raymap_file.h"

namespace nodal::host {
namespace {

media::Raymap raymap_of(const std::string& coding, int width, int height, std::vector<std::uint8_t> bytes) {
  media::Raymap raymap;
  raymap.meta.set = 42;
  raymap.meta.coding = coding;
  raymap.meta.width = width;
  raymap.meta.height = height;
  raymap.meta.layout = "equirectangular";
  raymap.bytes = std::move(bytes);
  return raymap;
}

Result<std::vector<std::uint8_t>> encode_png(const media::Raymap& raymap) {
  return media::encode(raymap, media::RaymapFormat::kPng);
}
Result<std::vector<std::uint8_t>> encode_tiff(const media::Raymap& raymap) {
  return media::encode(raymap, media::RaymapFormat::kTiff);
}

/// The pixels decoded by libpng's simplified reader: RGB.
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
  // Calculated by hand from JFIF's matrix: red is Y 76, Cb 85, Cr 255; blue is Y 29, Cb 255, Cr 107.
  const struct {
    std::uint8_t y, u, v;
    int r, g, b;
  } colours[] = {{76, 85, 255, 254, 0, 0},
                 {29, 255, 107, 0, 0, 254},
                 {255, 128, 128, 255, 255, 255},
                 {0, 128, 128, 0, 0, 0},
                 {128, 128, 128, 128, 128, 128}};
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

TEST(EncodePng, Nv12_IsTheSamePictureAsI420) {
  std::vector<std::uint8_t> i420(8 * 4 * 3 / 2), nv12(8 * 4 * 3 / 2);
  for (std::size_t i = 0; i < i420.size(); ++i) i420[i] = nv12[i] = static_cast<std::uint8_t>(50 + 5 * i);
  for (std::size_t i = 0; i < 8; ++i) {
    nv12[32 + 2 * i] = i420[32 + i];
    nv12[33 + 2 * i] = i420[40 + i];
  }
  EXPECT_EQ(*encode_png(raymap_of("NV12", 8, 4, nv12)), *encode_png(raymap_of("I420", 8, 4, i420)));
}

/// The bytes of a PNG's chunk, found by its name (PNG, 5.3).
std::string chunk(const std::vector<std::uint8_t>& png, const std::string& name) {
  for (std::size_t at = 8; at + 12 <= png.size();) {
    const std::size_t length =
        std::size_t{png[at]} << 24 | std::size_t{png[at + 1]} << 16 | std::size_t{png[at + 2]} << 8 | png[at + 3];
    const auto begin = png.begin() + static_cast<std::ptrdiff_t>(at + 4);
    if (std::string(begin, begin + 4) == name) return {begin + 4, begin + 4 + static_cast<std::ptrdiff_t>(length)};
    at += 12 + length;
  }
  return {};
}

TEST(EncodePng, SixteenBits_ComeBackToTheBitAndAreCalledLinear) {
  std::vector<std::uint8_t> bytes(4 * 2 * 6);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * 37 + 5);
  media::Raymap raymap = raymap_of("RGB48", 4, 2, bytes);
  raymap.meta.full_exposure_ns = 1'234'567;
  ASSERT_TRUE(check_raymap(raymap));
  const auto png = encode_png(raymap);
  ASSERT_TRUE(png) << png.error().text();
  EXPECT_EQ(chunk(*png, "IHDR").substr(8, 2), std::string("\x10\x02", 2)) << "16 bits of red, green, blue";
  EXPECT_EQ(chunk(*png, "gAMA"), std::string("\x00\x01\x86\xa0", 4)) << "100000: a gamma of one";
  EXPECT_EQ(chunk(*png, "sRGB"), "");
  EXPECT_NE(chunk(*png, "tEXt").find("full_exposure_ns=1234567"), std::string::npos);
  png_image image{};  // this reader returns linear numbers unchanged, in native byte order
  image.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_memory(&image, png->data(), png->size()), 0);
  image.format = PNG_FORMAT_LINEAR_RGB;
  std::vector<std::uint16_t> numbers(4 * 2 * 3);
  ASSERT_NE(png_image_finish_read(&image, nullptr, numbers.data(), 0, nullptr), 0);
  for (std::size_t i = 0; i < numbers.size(); ++i) EXPECT_EQ(numbers[i], bytes[2 * i] | bytes[2 * i + 1] << 8);
  const auto grey = encode_png(raymap_of("GREY16", 4, 2, std::vector<std::uint8_t>(16, 3)));
  ASSERT_TRUE(grey);
  EXPECT_EQ(chunk(*grey, "IHDR").substr(8, 2), std::string("\x10\x00", 2));
}

/// A TIFF read by libtiff from a file.
struct ReadTiff {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 0, channels = 0, photometric = 0;
  std::string description, xmp;
  std::vector<std::uint8_t> samples;
};
ReadTiff read_tiff(const std::vector<std::uint8_t>& bytes) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("nodal-tiff-" + std::to_string(::getpid()));
  std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
  ReadTiff read;
  TIFF* tiff = TIFFOpen(file.c_str(), "r");
  std::filesystem::remove(file);
  if (tiff == nullptr) return read;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &read.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &read.height);
  TIFFGetField(tiff, TIFFTAG_BITSPERSAMPLE, &read.bits);
  TIFFGetField(tiff, TIFFTAG_SAMPLESPERPIXEL, &read.channels);
  TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &read.photometric);
  char* words = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_IMAGEDESCRIPTION, &words) == 1) read.description = words;
  std::uint32_t length = 0;
  if (TIFFGetField(tiff, TIFFTAG_XMLPACKET, &length, &words) == 1) read.xmp.assign(words, length);
  const auto row = static_cast<std::size_t>(TIFFScanlineSize(tiff));
  read.samples.resize(row * read.height);
  for (std::uint32_t y = 0; y < read.height; ++y) TIFFReadScanline(tiff, read.samples.data() + row * y, y, 0);
  TIFFClose(tiff);
  return read;
}

TEST(EncodeTiff, EveryRawFormat_KeepsItsSamples) {
  const struct {
    std::string coding;
    std::uint16_t bits, channels, photometric;
  } formats[] = {{"GREY", 8, 1, PHOTOMETRIC_MINISBLACK},
                 {"RGB24", 8, 3, PHOTOMETRIC_RGB},
                 {"GREY16", 16, 1, PHOTOMETRIC_MINISBLACK},
                 {"RGB48", 16, 3, PHOTOMETRIC_RGB}};
  for (const auto& format : formats) {
    std::vector<std::uint8_t> bytes(80U * 40 * format.channels * format.bits / 8);
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * 37 + i / 256);
    const auto tiff = encode_tiff(raymap_of(format.coding, 80, 40, bytes));
    ASSERT_TRUE(tiff) << tiff.error().text();
    const ReadTiff read = read_tiff(*tiff);
    EXPECT_EQ(read.width, 80U);
    EXPECT_EQ(read.height, 40U);
    EXPECT_EQ(read.bits, format.bits);
    EXPECT_EQ(read.channels, format.channels);
    EXPECT_EQ(read.photometric, format.photometric);
    EXPECT_TRUE(read.samples == bytes) << format.coding;  // 16 bits are in the machine's order, low byte first here
    EXPECT_NE(read.xmp.find("GPano:ProjectionType"), std::string::npos);
    EXPECT_EQ(read.description.find("proportional to light") != std::string::npos, format.bits == 16);
  }
  std::vector<std::uint8_t> i420(8 * 4 * 3 / 2, 128);
  EXPECT_EQ(read_tiff(*encode_tiff(raymap_of("I420", 8, 4, i420))).samples, std::vector<std::uint8_t>(8 * 4 * 3, 128));
  EXPECT_EQ(encode_tiff(raymap_of("jpeg", 8, 4, i420)).error().code, Errc::kUnsupported);
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
    media::Raymap raymap;
    Errc code;
  } bad[] = {{raymap_of("jpeg", 4, 2, {0xFF, 0xD8, 1, 2, 3}), Errc::kTruncated},
             {raymap_of("jpeg", 4, 2, {}), Errc::kBadFormat},
             {raymap_of("jpeg", 4, 2, {1, 2, 3, 4, 0xFF, 0xD9}), Errc::kBadFormat},
             {raymap_of("I420", 4, 2, std::vector<std::uint8_t>(11)), Errc::kTruncated},
             {raymap_of("h266", 4, 2, {}), Errc::kUnsupported}};
  for (const auto& [raymap, code] : bad) {
    const Status status = check_raymap(raymap);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, code) << status.error().text();
    EXPECT_NE(status.error().message.find("set 42"), std::string::npos);
  }
}

TEST(ParseRaymapMeta, ASizeThatNoRigProduces_IsRefusedWithTheSet) {
  wire::RaymapHeader header;
  header.set_set(42);
  header.set_height(2);
  for (const std::uint32_t width : {0U, 16385U, 4'000'000'000U}) {
    header.set_width(width);
    const auto meta = parse_raymap_meta(header.SerializeAsString());
    ASSERT_FALSE(meta) << width;
    EXPECT_EQ(meta.error().code, Errc::kBadFormat);
    EXPECT_NE(meta.error().message.find("set 42"), std::string::npos);
  }
  header.set_width(16384);
  EXPECT_EQ(parse_raymap_meta(header.SerializeAsString())->width, 16384);
}

TEST(RawSidecar, I420_SaysWhereEveryPlaneLies) {
  const auto json = nlohmann::json::parse(media::raw_sidecar(raymap_of("I420", 8, 4, std::vector<std::uint8_t>(48))));
  EXPECT_EQ(json["set"], 42);
  EXPECT_EQ(json["range"], "full");
  ASSERT_EQ(json["planes"].size(), 3U);
  EXPECT_EQ(json["planes"][1]["offset"], 32);
  EXPECT_EQ(json["planes"][1]["width"], 4);
  EXPECT_EQ(json["planes"][2]["offset"], 40);
  EXPECT_EQ(json["planes"][2]["component"], "V");
}

TEST(RawSidecar, Rgb48_SaysHowItsNumbersLie) {
  media::Raymap raymap = raymap_of("RGB48", 4, 2, std::vector<std::uint8_t>(48));
  raymap.meta.full_exposure_ns = 99;
  const auto json = nlohmann::json::parse(media::raw_sidecar(raymap));
  EXPECT_EQ(json["bits"], 16);
  EXPECT_EQ(json["byte_order"], "little");
  EXPECT_EQ(json["numbers"], "linear");
  EXPECT_EQ(json["full_exposure_ns"], 99);
  EXPECT_EQ(json["planes"][1]["component"], "G");
  EXPECT_EQ(json["planes"][1]["offset"], 2);
  EXPECT_EQ(json["planes"][1]["pixel_stride"], 6);
}

TEST(RaymapFormat, ByNameAndByFile) {
  EXPECT_EQ(*media::raymap_format_of_name("a/b.jpg"), media::RaymapFormat::kJpg);
  EXPECT_EQ(*media::raymap_format_of_name("b-%06d.png"), media::RaymapFormat::kPng);
  EXPECT_EQ(*media::raymap_format_of_name("b.yuv"), media::RaymapFormat::kRaw);
  EXPECT_EQ(*media::raymap_format_of_name("b.tif"), media::RaymapFormat::kTiff);
  EXPECT_EQ(*media::raymap_format_of_name("b.tiff"), media::RaymapFormat::kTiff);
  EXPECT_FALSE(media::raymap_format_of_name("b.tga"));
  EXPECT_FALSE(media::parse_raymap_format("JPG"));
}

}  // namespace
}  // namespace nodal::host
