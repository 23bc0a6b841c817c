#include "stitch/media/image_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/support/pictures.h"

namespace nodal::media {
namespace {

using test::Sampling;

constexpr int kWidth = 50;
constexpr int kHeight = 34;

std::vector<std::uint8_t> picture() { return test::smooth_rgb(kWidth, kHeight); }

TEST(DecodePng, Rgb_IsBackToTheBit) {
  const auto image = decode_image(test::png_of(picture(), kWidth, kHeight, 3), "a.png");
  ASSERT_TRUE(image) << image.error().text();
  EXPECT_EQ(image->format, PixelFormat::kRgb24);
  EXPECT_EQ(image->width, kWidth);
  EXPECT_EQ(image->height, kHeight);
  EXPECT_EQ(image->bytes, picture());
}

TEST(DecodePng, GreyAlphaAnd16Bits_BecomeGreyAndRgbOf8) {
  const std::vector<std::uint8_t> grey{0, 50, 100, 150, 200, 255};
  EXPECT_EQ(decode_image(test::png_of(grey, 3, 2, 1), "g")->bytes, grey);
  const std::vector<std::uint8_t> grey_alpha{10, 255, 20, 0, 30, 128, 40, 1};
  const auto dropped = decode_image(test::png_of(grey_alpha, 2, 2, 2), "ga").value();
  EXPECT_EQ(dropped.format, PixelFormat::kGrey8);
  EXPECT_EQ(dropped.bytes, (std::vector<std::uint8_t>{10, 20, 30, 40}));
  const std::vector<std::uint8_t> rgba{1, 2, 3, 0, 4, 5, 6, 255};
  EXPECT_EQ(decode_image(test::png_of(rgba, 2, 1, 4), "rgba")->bytes, (std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6}));
  // 16 bits: v / 257 rounded, so 0xFFFF is 255, 0x8000 is 128 and 0x0100 is 1.
  const std::vector<std::uint8_t> deep{0xFF, 0xFF, 0x80, 0x00, 0x01, 0x00};
  EXPECT_EQ(decode_image(test::png_of(deep, 1, 1, 3, 16), "deep")->bytes, (std::vector<std::uint8_t>{255, 128, 1}));
}

TEST(DecodePng, Of16BitsOnRequest_KeepsThemAllWithTheLowerByteFirst) {
  const std::vector<std::uint8_t> deep{0x12, 0x34, 0x80, 0x00, 0xFF, 0xFE};
  const std::vector<std::uint8_t> swapped{0x34, 0x12, 0x00, 0x80, 0xFE, 0xFF};
  const auto rgb = decode_image(test::png_of(deep, 1, 1, 3, 16), "deep", PixelFormat::kRgb48).value();
  EXPECT_EQ(rgb.format, PixelFormat::kRgb48);
  EXPECT_EQ(rgb.bytes, swapped);
  EXPECT_EQ(decode_image(test::png_of(deep, 3, 1, 1, 16), "deep", PixelFormat::kGrey16)->bytes, swapped);
  // Alpha is dropped.
  const std::vector<std::uint8_t> grey_alpha{0x12, 0x34, 0x00, 0x01};
  EXPECT_EQ(decode_image(test::png_of(grey_alpha, 1, 1, 2, 16), "deep", PixelFormat::kGrey16)->bytes,
            (std::vector<std::uint8_t>{0x34, 0x12}));
  EXPECT_EQ(decode_image(test::png_of(deep, 1, 1, 3, 16), "deep", PixelFormat::kGrey16).error().code,
            Errc::kUnsupported);
  EXPECT_EQ(decode_image(test::png_of(deep, 2, 1, 3), "shallow", PixelFormat::kRgb48).error().code, Errc::kUnsupported);
  EXPECT_EQ(
      decode_image(test::jpeg_of(picture(), kWidth, kHeight, Sampling::k420), "jpeg", PixelFormat::kRgb48).error().code,
      Errc::kUnsupported);
  const auto whole = test::png_of(picture(), kWidth / 2, kHeight, 3, 16);
  for (std::size_t length = 0; length < whole.size(); length += 1 + length / 20) {
    const auto cut = decode_image(std::span(whole).first(length), "cut.png", PixelFormat::kRgb48);
    ASSERT_FALSE(cut) << length << " of " << whole.size();
    EXPECT_NE(cut.error().message.find("cut.png"), std::string::npos) << cut.error().text();
  }
}

TEST(DecodeJpeg, EachSampling_ComesInItsNaturalFormatCloseToTheOriginal) {
  for (const auto& [sampling, format] : {std::pair{Sampling::k420, PixelFormat::kI420},
                                         {Sampling::k422, PixelFormat::kRgb24},
                                         {Sampling::k444, PixelFormat::kRgb24},
                                         {Sampling::kGrey, PixelFormat::kGrey8}}) {
    const auto bytes = test::jpeg_of(picture(), kWidth, kHeight, sampling);
    const auto natural = decode_image(bytes, "a.jpg");
    ASSERT_TRUE(natural) << natural.error().text();
    EXPECT_EQ(natural->format, format);
    EXPECT_EQ(natural->bytes.size(), packed_size(format, kWidth, kHeight));
    if (sampling == Sampling::kGrey) continue;
    const auto rgb = decode_image(bytes, "a.jpg", PixelFormat::kRgb24);
    EXPECT_GT(test::psnr(rgb->bytes, picture()), 35);
  }
}

// A uniform grey gives that level in every plane, including black and white: full range, not video range.
TEST(DecodeJpeg, BlackAndWhite_AreZeroAnd255InI420) {
  for (const int level : {0, 255}) {
    const std::vector<std::uint8_t> flat(3 * 32 * 32, static_cast<std::uint8_t>(level));
    const auto image = decode_image(test::jpeg_of(flat, 32, 32, Sampling::k420), "flat.jpg").value();
    EXPECT_EQ(image.bytes.front(), level);
    EXPECT_EQ(image.bytes.back(), 128);
  }
}

class Broken : public testing::TestWithParam<bool> {
 protected:
  std::vector<std::uint8_t> good() const {
    return GetParam() ? test::jpeg_of(picture(), kWidth, kHeight, Sampling::k420)
                      : test::png_of(picture(), kWidth, kHeight, 3);
  }
};

// Never a picture whose missing part is grey.
TEST_P(Broken, CutAtEveryByte_IsOneErrorThatNamesThePicture) {
  const auto whole = good();
  ASSERT_TRUE(decode_image(whole, "whole"));
  for (std::size_t length = 0; length + 4 < whole.size(); length += 1 + length / 40) {
    const auto image = decode_image(std::span(whole).first(length), "cut.pic");
    ASSERT_FALSE(image) << "cut at " << length << " of " << whole.size();
    EXPECT_NE(image.error().message.find("'cut.pic'"), std::string::npos);
    EXPECT_TRUE(image.error().code == Errc::kTruncated || image.error().code == Errc::kBadFormat);
  }
  EXPECT_EQ(decode_image(std::span(whole).first(whole.size() / 2), "half").error().code, Errc::kTruncated);
}

// A flipped bit may leave a valid JPEG; reading must not crash, and the size must be as in the header.
TEST_P(Broken, BytesChanged_NeverMoreThanAnError) {
  const auto whole = good();
  std::uint64_t draw = 99;
  int refused = 0;
  for (int i = 0; i < 400; ++i) {
    auto bytes = whole;
    for (int k = 0; k < 4; ++k) {
      draw = draw * 6364136223846793005ULL + 1442695040888963407ULL;
      bytes[(draw >> 33) % bytes.size()] ^= static_cast<std::uint8_t>(1U << ((draw >> 20) % 8));
    }
    const auto image = decode_image(bytes, "changed");
    if (!image) {
      ++refused;
      continue;
    }
    EXPECT_EQ(image->bytes.size(), packed_size(image->format, image->width, image->height));
  }
  EXPECT_GT(refused, 40);
}

TEST(ImageFile, MorePixelsThanAPictureMayHave_AreRefused) {
  auto jpeg = test::jpeg_of(test::smooth_rgb(64, 48), 64, 48, test::Sampling::k420);
  const std::array<std::uint8_t, 2> frame{0xFF, 0xC0};  // JPEG, B.2.2: then length, precision, height and width
  const auto at = std::search(jpeg.begin(), jpeg.end(), frame.begin(), frame.end());
  ASSERT_LT(at - jpeg.begin(), static_cast<std::ptrdiff_t>(jpeg.size()) - 9);
  for (const int side : {32'768, 23'171}) {  // 23170 * 23170 are just below 2^29
    at[5] = at[7] = static_cast<std::uint8_t>(side >> 8);
    at[6] = at[8] = static_cast<std::uint8_t>(side);
    auto padded = jpeg;
    padded.resize(4'000'000);
    const auto image = decode_image(padded, "huge");
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, Errc::kTooLarge) << image.error().text();
    const std::string size = std::to_string(side) + "x" + std::to_string(side);
    EXPECT_EQ(image.error().message, "picture 'huge': is " + size + ", over the limit of 512 * 2^20 pixels");
  }
}

INSTANTIATE_TEST_SUITE_P(Kind, Broken, testing::Values(true, false),
                         [](const auto& kind) { return kind.param ? "Jpeg" : "Png"; });

TEST(ImageFile, JpegsOfOddSize_HaveNoSamplesOfOtherPlanes) {
  std::vector<std::uint8_t> orange;
  for (int i = 0; i < 33 * 31; ++i) orange.insert(orange.end(), {230, 120, 20});
  const auto image =
      decode_image(test::jpeg_of(orange, 33, 31, Sampling::k420), "odd.jpg", PixelFormat::kRgb24).value();
  for (std::size_t i = 0; i < orange.size(); ++i) ASSERT_NEAR(image.bytes[i], orange[i], 3) << i;
}

TEST(DecodeJpeg, FewBytesThatClaimAGreatPicture_AreRefusedBeforeMemoryIsTaken) {
  std::vector<std::uint8_t> bytes = test::jpeg_of(picture(), kWidth, kHeight, Sampling::k420);
  const std::array<std::uint8_t, 2> frame_header{0xFF, 0xC0};
  const auto found = std::ranges::search(bytes, frame_header);
  ASSERT_FALSE(found.empty());
  // After the marker: length (2), precision (1), height (2), width (2), high byte first.
  found.begin()[5] = found.begin()[7] = 0x50;  // 20480 and more
  const auto image = decode_image(bytes, "great.jpg");
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().code, Errc::kTruncated);
  EXPECT_NE(image.error().message.find("bytes cannot hold"), std::string::npos) << image.error().message;
}

TEST(ReadImage, NotAPicture_SaysSoByName) {
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "notes.txt", {'h', 'e', 'l', 'l', 'o'});
  test::write_bytes(folder / "empty.jpg", {});
  const auto check = [&](const std::string& name, Errc code) {
    const auto image = read_image(folder / name);
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, code) << image.error().text();
    EXPECT_NE(image.error().message.find(name), std::string::npos);
    EXPECT_FALSE(read_image_header(folder / name));
  };
  check("notes.txt", Errc::kBadFormat);
  check("empty.jpg", Errc::kTruncated);
  check("missing.png", Errc::kNotFound);
  std::filesystem::create_directory(folder / "folder.png");
  check("folder.png", Errc::kBadFormat);
}

TEST(ReadImage, FormatsThatPeopleHavePicturesIn_AreNamedWithWhatToDo) {
  using namespace std::string_literals;
  const std::array<std::array<std::string, 2>, 7> files{{{"\0\0\0\x18"s + "ftypheic", "HEIF"},
                                                         {"\0\0\0\x20"s + "ftypmp42", "film"},
                                                         {"RIFF....WEBPVP8 ", "WebP"},
                                                         {"II*\0\x08\0\0\0"s, "TIFF"},
                                                         {"MM\0*\0\0\0\x08"s, "TIFF"},
                                                         {"ftyp", "a text file, not a picture"},
                                                         {"\1\2\3\4"s, "a file of an unknown format"}}};
  for (const auto& [bytes, said] : files) {
    const auto image = decode_image(std::vector<std::uint8_t>(bytes.begin(), bytes.end()), "a.jpg");
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, Errc::kBadFormat);
    EXPECT_NE(image.error().message.find(said), std::string::npos) << image.error().message;
  }
}

/// A JPEG with segments behind its first marker.
std::vector<std::uint8_t> jpeg_with(const std::vector<std::pair<std::uint8_t, std::string>>& segments) {
  std::vector<std::uint8_t> jpeg = test::jpeg_of(test::smooth_rgb(16, 16), 16, 16, test::Sampling::k444);
  std::vector<std::uint8_t> more;
  for (const auto& [marker, body] : segments) {
    const std::size_t length = body.size() + 2;
    more.insert(more.end(), {0xFF, marker, static_cast<std::uint8_t>(length >> 8), static_cast<std::uint8_t>(length)});
    more.insert(more.end(), body.begin(), body.end());
  }
  jpeg.insert(jpeg.begin() + 2, more.begin(), more.end());
  return jpeg;
}

TEST(JpegSegments, AProfileInParts_IsPutTogetherByTheirNumbers) {
  const std::string begin("ICC_PROFILE\0", 12);
  const auto part = [&](char number, const std::string& bytes) {
    return std::pair<std::uint8_t, std::string>(0xE2, begin + number + '\3' + bytes);
  };
  // As ICC.1:2010, B.4 allows it: in any order, and other segments between them.
  const auto jpeg = jpeg_with({part('\3', "CC"), {0xE2, "MPF other"}, part('\1', "AA"), part('\2', "BB")});
  const std::vector<std::uint8_t> whole{'A', 'A', 'B', 'B', 'C', 'C'};
  EXPECT_EQ(decode_image(jpeg, "p.jpg").value().meaning.icc, whole);
}

TEST(ReadImageHeader, BehindALotOfMetadata_IsFound) {
  const test::TemporaryFolder folder;
  auto jpeg = test::jpeg_of(picture(), kWidth, kHeight, Sampling::k420);
  // Three APP1 segments of 65533 bytes after the start marker.
  for (int i = 0; i < 3; ++i) {
    std::vector<std::uint8_t> segment{0xFF, 0xE1, 0xFF, 0xFF};
    segment.resize(2 + 0xFFFF, 'x');
    jpeg.insert(jpeg.begin() + 2, segment.begin(), segment.end());
  }
  test::write_bytes(folder / "long.jpg", jpeg);
  const auto header = read_image_header(folder / "long.jpg");
  ASSERT_TRUE(header) << header.error().text();
  EXPECT_EQ(header->width, kWidth);
  EXPECT_EQ(header->natural, PixelFormat::kI420);
}

TEST(ConvertImage, EveryFormatToEveryOther_KeepsASmoothPicture) {
  const auto formats = {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy,
                        PixelFormat::kRgb24};
  const auto rgb = picture();
  const ImageView original = packed_image(PixelFormat::kRgb24, kWidth, kHeight, rgb.data());
  for (const PixelFormat from : formats) {
    const DecodedImage first = convert_image(original, from);
    for (const PixelFormat to : formats) {
      const DecodedImage second = convert_image(first.view(), to);
      const DecodedImage back = convert_image(second.view(), PixelFormat::kRgb24);
      EXPECT_GT(test::psnr(back.bytes, rgb), 38) << pixel_format_name(from) << " to " << pixel_format_name(to);
    }
    EXPECT_EQ(convert_image(first.view(), from).bytes, first.bytes);
  }
}

// JFIF 1.02: Y = 0.299 R + 0.587 G + 0.114 B and so on; chroma positions as in PlaneGrid.
TEST(ConvertImage, KnownColours_AreJfifs) {
  for (const auto& [rgb, yuv] : {std::pair{std::array{255, 0, 0}, std::array{76, 85, 255}},
                                 {std::array{0, 255, 0}, std::array{150, 44, 21}},
                                 {std::array{0, 0, 255}, std::array{29, 255, 107}},
                                 {std::array{90, 90, 90}, std::array{90, 128, 128}}}) {
    std::vector<std::uint8_t> flat;
    for (int i = 0; i < 8 * 4; ++i) flat.insert(flat.end(), rgb.begin(), rgb.end());
    const auto image =
        convert_image(packed_image(PixelFormat::kRgb24, 8, 4, std::as_const(flat).data()), PixelFormat::kYuyv);
    const ImageView view = image.view();
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(view.planes[c].data[0], yuv[c]) << c;
  }
}

// A colour ramp from left to right: a wrong chroma position shows as an offset of the values.
TEST(ConvertImage, ChromaPlacement_FollowsThePlaneGrid) {
  std::vector<std::uint8_t> rgb;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 64; ++x) rgb.insert(rgb.end(), {128, 128, static_cast<std::uint8_t>(2 * x + 64)});
  }
  const ImageView original = packed_image(PixelFormat::kRgb24, 64, 8, std::as_const(rgb).data());
  for (const PixelFormat format : {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy}) {
    const DecodedImage image = convert_image(original, format);
    const PlaneView u = image.view().planes[1];
    const PlaneGrid grid = component_grid(format, 1);
    for (int i = 4; i < 28; ++i) {
      const double x = (i + 0.5 - grid.offset_x) * grid.step_x - 0.5;  // pixel index
      const double blue = 2 * x + 64;
      const double expected = 128 - 0.168736 * 128 - 0.331264 * 128 + 0.5 * blue;
      EXPECT_NEAR(u.data[i * u.pixel_stride], expected, 0.51) << pixel_format_name(format) << " " << i;
    }
  }
}

}  // namespace
}  // namespace nodal::media
