// What is no picture, by its first bytes as the formats' specifications have them, and by its name.
#include "stitch/media/file_kind.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"

namespace nodal::media {
namespace {

using namespace std::string_literals;

std::string kind_of_bytes(const std::string& bytes, const std::string& name) {
  const FileKind* kind = file_kind({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, name);
  return kind == nullptr ? "a picture" : std::string(kind->one);
}

/// A TIFF's header and first directory, little-endian: tags with one value each, of 32 bits.
std::string tiff(const std::vector<std::pair<std::uint32_t, std::uint32_t>>& tags) {
  const auto number = [](std::uint32_t value, int bytes) {
    std::string text;
    for (int k = 0; k < bytes; ++k) text += static_cast<char>(value >> (8 * k) & 255);
    return text;
  };
  std::string text = "II*\0"s + number(8, 4) + number(static_cast<std::uint32_t>(tags.size()), 2);
  for (const auto& [tag, value] : tags) text += number(tag, 2) + number(4, 2) + number(1, 4) + number(value, 4);
  return text + number(0, 4);
}

TEST(FileKind, ByContent_WhateverItsName) {
  struct {
    std::string bytes, kind;
  } const kFiles[] = {
      {"", "an empty file"},
      {"\xff\xd8\xff\xe0"s, "a picture"},
      {"\x89PNG\r\n\x1a\n"s, "a picture"},
      {"\0\0\0\x18"s + "ftypheic\0\0\0\0mif1heic"s, "an HEIF file"},
      {"\0\0\0\x1c"s + "ftypavif\0\0\0\0avifmif1"s, "an AVIF file"},
      {"\0\0\0\x1c"s + "ftypmif1\0\0\0\0mif1avif"s, "an AVIF file"},
      {"\0\0\0\x18"s + "ftypcrx \0\0\0\1"s, "a camera's raw file"},
      {"\0\0\0\x18"s + "ftypisom\0\0\2\0"s, "a film"},
      {"\x1a\x45\xdf\xa3\x01"s, "a film"},
      {"RIFF\1\2\3\4AVI LIST"s, "a film"},
      {"RIFF\1\2\3\4WEBPVP8 "s, "a WebP file"},
      {"FUJIFILMCCD-RAW 0201"s, "a camera's raw file"},
      {"IIRO\x08\0\0\0"s, "a camera's raw file"},
      {"IIU\0\x18\0\0\0"s, "a camera's raw file"},
      {"II*\0\x10\0\0\0CR\2\0"s, "a camera's raw file"},
      {"GIF89a\1"s, "a GIF file"},
      {"BM\x36\0\0\0"s, "a BMP file"},
      {"P6\n2 2\n255\n"s, "a PNM file"},
      {"8BPS\0\1"s, "a Photoshop file"},
      {"v/1\1\2\0\0\0"s, "an OpenEXR file"},
      {"#?RADIANCE\n"s, "a Radiance HDR file"},
      {"\0\0\0\x0cjP  \r\n\x87\n"s, "a JPEG 2000 file"},
      {"\xff\x0a\1"s, "a JPEG XL file"},
      {"%PDF-1.7"s, "a PDF"},
      {"PK\3\4\x14"s, "an archive"},
      {"{\"nodal_calibration\": 1}\n"s, "a text file, not a picture (JPEG, PNG, TIFF, HEIF and WebP are read)"}};
  for (const auto& [bytes, kind] : kFiles) {
    EXPECT_EQ(kind_of_bytes(bytes, "IMG_1.JPG"), kind) << bytes;
    EXPECT_EQ(kind_of_bytes(bytes, "IMG_1"), kind) << bytes;
  }
}

TEST(FileKind, TiffOfACameraOrOfAProgram_ByItsFirstDirectoryAndItsName) {
  const std::string picture = tiff({{254, 0}, {256, 640}, {257, 480}, {262, 2}});
  EXPECT_EQ(kind_of_bytes(picture, "a.tif"), "a picture");
  EXPECT_EQ(kind_of_bytes(picture, "a.NEF"), "a camera's raw file");
  const std::string kRaw = "a camera's raw file";
  EXPECT_EQ(kind_of_bytes(tiff({{254, 1}, {256, 160}, {262, 2}}), "a.tif"), kRaw);  // a reduced picture is first
  EXPECT_EQ(kind_of_bytes(tiff({{254, 0}, {262, 32803}}), "a.tif"), kRaw);          // the sensor's numbers
  EXPECT_EQ(kind_of_bytes(tiff({{254, 0}, {262, 34892}}), "a.tif"), kRaw);
  EXPECT_EQ(kind_of_bytes(tiff({{254, 0}, {262, 2}, {50706, 1025}}), "a.tif"), kRaw);  // DNGVersion
  // Cut anywhere, or with a directory far away, nothing is read behind the end.
  for (std::size_t length = 4; length < picture.size(); ++length) kind_of_bytes(picture.substr(0, length), "a.tif");
  EXPECT_EQ(kind_of_bytes("II*\0\xff\xff\xff\xff"s, "a.tif"), "a picture");
}

TEST(FileKind, ByName_WhereTheContentSaysNothing) {
  const std::string bytes = "\1\2\3\4\5\6\7\x08\1\2\3\4";
  EXPECT_EQ(kind_of_bytes(bytes, "DSC_1.CR3"), "a camera's raw file");
  EXPECT_EQ(kind_of_bytes(bytes, "VID.MP4"), "a film");
  EXPECT_EQ(kind_of_bytes(bytes, "a.heic"), "an HEIF file");
  EXPECT_EQ(kind_of_bytes(bytes, "folder.heic/a").substr(0, 27), "a file of an unknown format");
}

std::string refusal(const std::filesystem::path& file) {
  const auto picture = read_image(file);
  return picture ? "read" : picture.error().message;
}

TEST(ReadImage, PngThatIsTooWide_IsNamedWithItsSize) {
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "wide.png", test::png_of(std::vector<std::uint8_t>(33000 * 4), 33000, 4, 1));
  EXPECT_NE(refusal(folder / "wide.png").find("is 33000x4, over the limit of 32768 a side"), std::string::npos)
      << refusal(folder / "wide.png");
}

TEST(ReadImage, JpegWithUnusualSampling_IsReadAsOtherProgramsReadIt) {
  struct Pixel {
    std::size_t x, y;
    int red, green, blue;
  };
  // Values by ImageMagick 6.9.
  const std::vector<std::pair<std::string, std::vector<Pixel>>> kFiles{
      {"sampling_421", {{20, 20, 126, 0, 1}, {200, 100, 223, 223, 223}, {240, 10, 57, 57, 57}}},
      {"sampling_chroma_finer", {{20, 20, 126, 0, 1}, {200, 100, 222, 222, 222}, {240, 10, 57, 57, 57}}}};
  const std::filesystem::path folder = std::filesystem::path(NODAL_SOURCE_DIR) / "tests/fuzz/corpus/jpeg";
  for (const auto& [name, pixels] : kFiles) {
    const auto header = read_image_header(folder / name);
    ASSERT_TRUE(header) << header.error().text();
    EXPECT_EQ(header->width, 256);
    const auto image = read_image(folder / name);
    ASSERT_TRUE(image) << image.error().text();
    ASSERT_EQ(image->format, PixelFormat::kRgb24);
    for (const Pixel& p : pixels) {
      const std::uint8_t* at = &image->bytes[3 * (p.y * 256 + p.x)];
      EXPECT_NEAR(at[0], p.red, 3) << name;
      EXPECT_NEAR(at[1], p.green, 3) << name;
      EXPECT_NEAR(at[2], p.blue, 3) << name;
    }
  }
}

}  // namespace
}  // namespace nodal::media
