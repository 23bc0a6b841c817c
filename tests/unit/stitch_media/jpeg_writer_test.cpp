#include "stitch/media/jpeg_writer.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <array>
#include <memory>
#include <string>
#include <utility>

#include "stitch/media/image_file.h"

namespace nodal::media {
namespace {

constexpr int kJpegWidth = 48, kJpegHeight = 32;

/// Ramps in every component, so that transposed or swapped planes are detected.
std::vector<std::uint8_t> slopes(PixelFormat format) {
  std::vector<std::uint8_t> bytes(packed_size(format, kJpegWidth, kJpegHeight));
  const MutableImageView image = packed_image(format, kJpegWidth, kJpegHeight, bytes.data());
  for (int c = 0; c < component_count(format); ++c) {
    const MutablePlaneView& plane = image.planes[static_cast<std::size_t>(c)];
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        plane.data[y * plane.row_stride + static_cast<std::ptrdiff_t>(x) * plane.pixel_stride] =
            static_cast<std::uint8_t>(90 + 20 * c + (c == 1 ? 2 * x : x) + (c == 2 ? 2 * y : y));
      }
    }
  }
  return bytes;
}

std::vector<std::uint8_t> written(PixelFormat format, const std::vector<std::uint8_t>& pixels, std::string_view xmp,
                                  std::string_view comment) {
  JpegWriter writer({format, kJpegWidth, kJpegHeight, 100, xmp});
  std::vector<std::uint8_t> file;
  EXPECT_TRUE(writer.write(packed_image(format, kJpegWidth, kJpegHeight, pixels.data()), comment, file));
  return file;
}

// At quality 100 coefficients have steps of 1: samples come back within 1.5 levels. B = Y + 1.772 (U - 128) adds the
// errors of two components: 1.5 (1 + 1.772) < 4.2.
TEST(JpegWriter, EveryFormat_IsReadBackWithinTheErrorOfItsCoding) {
  for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kI420, PixelFormat::kRgb24}) {
    const auto pixels = slopes(format);
    const auto read = decode_image(written(format, pixels, "", "x"), "x.jpg");
    ASSERT_TRUE(read) << read.error().text();
    ASSERT_EQ(read->format, format);
    ASSERT_EQ(read->bytes.size(), pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i)
      ASSERT_NEAR(read->bytes[i], pixels[i], format == PixelFormat::kRgb24 ? 4 : 2) << int(format) << " " << i;
  }
}

TEST(JpegWriter, Nv12_IsTheFileOfTheSamePictureInI420) {
  EXPECT_EQ(written(PixelFormat::kNv12, slopes(PixelFormat::kNv12), "", "x"),
            written(PixelFormat::kI420, slopes(PixelFormat::kI420), "", "x"));
}

// Packed 4:1:1 is U Y Y V Y Y for 4 pixels; TurboJPEG, asked for planes, gives each component back by itself.
TEST(JpegWriter, Yuv411_IsCodedAs411WithEverySampleInItsPlace) {
  constexpr int kWide = 46;  // its last group has 2 pixels
  std::vector<std::uint8_t> packed(packed_size(PixelFormat::kYuv411, kWide, kJpegHeight));
  const auto luma = [](int x, int y) { return static_cast<std::uint8_t>(40 + 3 * x + y); };
  const auto chroma = [](int c, int x, int y) {
    return static_cast<std::uint8_t>(c == 1 ? 60 + 4 * x : 200 - 5 * x - y);
  };
  for (int y = 0; y < kJpegHeight; ++y) {
    for (int k = 0; k < 12; ++k) {
      std::uint8_t* const group = packed.data() + y * yuv411_row_bytes(kWide) + 6 * k;
      for (const auto& [at, x] : {std::pair{1, 0}, {2, 1}, {4, 2}, {5, 3}}) group[at] = luma(4 * k + x, y);
      group[0] = chroma(1, k, y);
      group[3] = chroma(2, k, y);
    }
  }
  JpegWriter writer({PixelFormat::kYuv411, kWide, kJpegHeight, 100});
  std::vector<std::uint8_t> file;
  ASSERT_TRUE(
      writer.write(packed_image(PixelFormat::kYuv411, kWide, kJpegHeight, std::as_const(packed).data()), "", file));

  const std::unique_ptr<void, int (*)(tjhandle)> reader(tjInitDecompress(), tjDestroy);
  int width = 0, height = 0, sampling = 0, space = 0;
  ASSERT_EQ(tjDecompressHeader3(reader.get(), file.data(), file.size(), &width, &height, &sampling, &space), 0);
  EXPECT_EQ(width, kWide);
  EXPECT_EQ(height, kJpegHeight);
  ASSERT_EQ(sampling, TJSAMP_411);
  std::array<std::vector<std::uint8_t>, 3> planes;
  std::array<unsigned char*, 3> data{};
  for (int c = 0; c < 3; ++c) {
    planes[static_cast<std::size_t>(c)].resize(tjPlaneSizeYUV(c, width, 0, height, sampling));
    data[static_cast<std::size_t>(c)] = planes[static_cast<std::size_t>(c)].data();
  }
  ASSERT_EQ(tjDecompressToYUVPlanes(reader.get(), file.data(), file.size(), data.data(), 0, nullptr, 0, 0), 0);
  for (int c = 0; c < 3; ++c) {
    const int columns = tjPlaneWidth(c, width, sampling);
    ASSERT_EQ(columns, c == 0 ? kWide + 2 : 12) << c;  // TurboJPEG rounds up to whole groups
    for (int y = 0; y < kJpegHeight; ++y) {
      for (int x = 0; x < (c == 0 ? kWide : columns); ++x) {
        const int is = planes[static_cast<std::size_t>(c)][static_cast<std::size_t>(y * columns + x)];
        ASSERT_NEAR(is, c == 0 ? luma(x, y) : chroma(c, x, y), 2) << c << " " << x << " " << y;
      }
    }
  }
}

TEST(JpegWriter, XmpAndComment_StandBehindJfifInThisOrder) {
  const auto file = written(PixelFormat::kGrey8, slopes(PixelFormat::kGrey8), "<xmp/>", "a comment");
  const std::string text(file.begin(), file.end());
  // ITU T.81 B.1.1.4: ff, marker, two bytes of length, which include themselves.
  const std::string app1 =
      std::string("\xff\xe1\x00\x25", 4) + std::string("http://ns.adobe.com/xap/1.0/\0", 29) + "<xmp/>";
  const std::string com = std::string("\xff\xfe\x00\x0b", 4) + "a comment";
  EXPECT_EQ(text.substr(0, 4), "\xff\xd8\xff\xe0");
  const std::size_t jfif = 4 + (static_cast<std::size_t>(file[4]) << 8 | file[5]);
  EXPECT_EQ(text.substr(jfif, app1.size() + com.size()), app1 + com);
}

TEST(JpegWriter, NoXmp_NoApp1) {
  const auto file = written(PixelFormat::kGrey8, slopes(PixelFormat::kGrey8), "", "c");
  EXPECT_EQ(std::string(file.begin(), file.end()).find("\xff\xe1"), std::string::npos);
}

TEST(JpegWriter, ASecondPictureIntoALargerBuffer_LeavesNothingOfWhatWasThere) {
  JpegWriter writer({PixelFormat::kRgb24, kJpegWidth, kJpegHeight, 90, ""});
  const auto pixels = slopes(PixelFormat::kRgb24);
  std::vector<std::uint8_t> first, second(1'000'000, 1);
  ASSERT_TRUE(writer.write(packed_image(PixelFormat::kRgb24, kJpegWidth, kJpegHeight, pixels.data()), "c", first));
  ASSERT_TRUE(writer.write(packed_image(PixelFormat::kRgb24, kJpegWidth, kJpegHeight, pixels.data()), "c", second));
  EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace nodal::media
