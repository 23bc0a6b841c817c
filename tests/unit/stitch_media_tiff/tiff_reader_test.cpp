#include "stitch/media/tiff/tiff_reader.h"

#include <gtest/gtest.h>
#include <tiffio.h>

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>

#include "stitch/media/picture_bytes.h"
#include "tests/support/pictures.h"

namespace nodal::media {
namespace {

constexpr int kWidth = 50;
constexpr int kHeight = 34;
constexpr std::uint32_t kTile = 16;

/// How libtiff stores the picture.
struct Kind {
  int channels = 3;
  int bits = 8;
  bool tiles = false;
  bool by_plane = false;
  std::uint16_t compression = COMPRESSION_NONE;
  const char* mode = "w";  ///< with b: big-endian; with 8: BigTIFF
};

class TiffReader : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  /// Sample c of pixel (x, y) of the picture, 0..65535; for 8 bits, its upper byte.
  static int sample(int x, int y, int c) { return (x * 1201 + y * 907 + c * 7919 + x * y * 13) & 0xffff; }
  /// The sample, rounded from 16 bits to 8 by the definition: v / 257.
  static int expected(int x, int y, int c, const Kind& kind) {
    const int value = sample(x, y, c);
    return kind.bits == 16 ? (value + 128) / 257 : value >> 8;
  }

  /// A block of the picture, interleaved, or of one channel.
  static std::vector<std::uint8_t> block(const Kind& kind, int left, int top, int width, int height, int channel) {
    std::vector<std::uint8_t> bytes;
    for (int y = top; y < top + height; ++y) {
      for (int x = left; x < left + width; ++x) {
        for (int c = 0; c < kind.channels; ++c) {
          if (channel >= 0 && c != channel) continue;
          const auto value = static_cast<std::uint16_t>(sample(x, y, c));
          if (kind.bits == 8) {
            bytes.push_back(static_cast<std::uint8_t>(value >> 8));
          } else {
            bytes.resize(bytes.size() + 2);
            std::memcpy(&bytes[bytes.size() - 2], &value, 2);
          }
        }
      }
    }
    return bytes;
  }

  /// `alpha`: what the last of 2 or 4 channels is.
  std::string write(const std::string& name, const Kind& kind, std::uint16_t alpha = EXTRASAMPLE_UNSPECIFIED) const {
    TIFF* tiff = TIFFOpen(path(name).c_str(), kind.mode);
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, kWidth);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, kHeight);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, kind.channels);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, kind.bits);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, kind.by_plane ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, kind.channels < 3 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
    if (kind.channels % 2 == 0) TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &alpha);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, kind.compression);
    TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_BOTRIGHT);  // rows are to be taken as they are stored
    const int planes = kind.by_plane ? kind.channels : 1;
    if (kind.tiles) {
      TIFFSetField(tiff, TIFFTAG_TILEWIDTH, kTile);
      TIFFSetField(tiff, TIFFTAG_TILELENGTH, kTile);
      for (int p = 0; p < planes; ++p) {
        for (std::uint32_t y = 0; y < kHeight; y += kTile) {
          for (std::uint32_t x = 0; x < kWidth; x += kTile) {
            auto bytes = block(kind, static_cast<int>(x), static_cast<int>(y), kTile, kTile, kind.by_plane ? p : -1);
            TIFFWriteTile(tiff, bytes.data(), x, y, 0, static_cast<std::uint16_t>(p));
          }
        }
      }
    } else {
      TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 7);
      for (int p = 0; p < planes; ++p) {
        for (int y = 0; y < kHeight; ++y) {
          auto bytes = block(kind, 0, y, kWidth, 1, kind.by_plane ? p : -1);
          TIFFWriteScanline(tiff, bytes.data(), static_cast<std::uint32_t>(y), static_cast<std::uint16_t>(p));
        }
      }
    }
    TIFFClose(tiff);
    return path(name);
  }

  test::TemporaryFolder folder_;
};

TEST_F(TiffReader, StripsTilesPlanesDepthsAndByteOrders_GiveTheSameSamples) {
  for (const Kind& kind :
       {Kind{}, Kind{3, 16}, Kind{1, 8}, Kind{1, 16}, Kind{3, 8, true}, Kind{3, 16, true}, Kind{3, 8, false, true},
        Kind{3, 16, true, true, COMPRESSION_LZW}, Kind{3, 16, false, false, COMPRESSION_ADOBE_DEFLATE, "wb"},
        Kind{1, 16, true, false, COMPRESSION_NONE, "wb"}, Kind{3, 8, false, false, COMPRESSION_LZW, "w8"}}) {
    const std::string file = write("a.tif", kind);
    SCOPED_TRACE(testing::Message() << kind.channels << " x " << kind.bits << (kind.tiles ? " tiles" : " strips")
                                    << (kind.by_plane ? " by plane " : " ") << kind.compression << kind.mode);
    EXPECT_TRUE(is_tiff(file));
    const auto picture = read_tiff(file);
    ASSERT_TRUE(picture) << picture.error().text();
    EXPECT_EQ(picture->format, kind.channels == 1 ? PixelFormat::kGrey8 : PixelFormat::kRgb24);
    const auto header = read_tiff_header(file);
    ASSERT_TRUE(header);
    EXPECT_EQ(header->natural, picture->format);
    ASSERT_EQ(picture->width, kWidth);
    ASSERT_EQ(picture->height, kHeight);
    std::size_t at = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (int c = 0; c < kind.channels; ++c, ++at) {
          ASSERT_EQ(picture->bytes[at], expected(x, y, c, kind)) << x << " " << y << " " << c;
        }
      }
    }
  }
}

TEST_F(TiffReader, Of16BitsOnRequest_KeepsThemAll) {
  for (const Kind& kind :
       {Kind{3, 16}, Kind{1, 16}, Kind{3, 16, true}, Kind{3, 16, true, true, COMPRESSION_LZW},
        Kind{3, 16, false, true, COMPRESSION_ADOBE_DEFLATE, "wb"}, Kind{1, 16, true, false, COMPRESSION_NONE, "wb"},
        Kind{4, 16}, Kind{4, 16, true, true}, Kind{2, 16}, Kind{4, 16, false, false, COMPRESSION_LZW, "w8"}}) {
    for (const int alpha : {EXTRASAMPLE_UNSPECIFIED, EXTRASAMPLE_ASSOCALPHA, EXTRASAMPLE_UNASSALPHA}) {
      if (kind.channels % 2 == 1 && alpha != EXTRASAMPLE_UNSPECIFIED) continue;
      const std::string file = write("a.tif", kind, static_cast<std::uint16_t>(alpha));
      SCOPED_TRACE(testing::Message() << kind.channels << (kind.tiles ? " tiles" : " strips")
                                      << (kind.by_plane ? " by plane " : " ") << kind.compression << ", alpha "
                                      << alpha);
      const int channels = kind.channels < 3 ? 1 : 3;
      const PixelFormat format = channels == 1 ? PixelFormat::kGrey16 : PixelFormat::kRgb48;
      EXPECT_EQ(read_tiff_header(file)->deep, format);
      const auto picture = read_tiff(file, format);
      ASSERT_TRUE(picture) << picture.error().text();
      ASSERT_EQ(picture->format, format);
      ASSERT_EQ(picture->bytes.size(), packed_size(format, kWidth, kHeight));
      std::size_t at = 0;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          for (int c = 0; c < channels; ++c, at += 2) {
            // Multiplied by alpha only if the file says so.
            const bool multiplied = alpha == EXTRASAMPLE_ASSOCALPHA && sample(x, y, channels) > 0;
            const double opaque = multiplied ? sample(x, y, channels) / 65535.0 : 1;
            const int got = picture->bytes[at] | picture->bytes[at + 1] << 8;
            ASSERT_NEAR(got, std::min(65535.0, sample(x, y, c) / opaque), multiplied ? 0.51 : 0) << x << " " << y;
          }
        }
      }
    }
  }
  EXPECT_FALSE(read_tiff_header(write("a.tif", {3, 8}))->deep);
  EXPECT_EQ(read_tiff(path("a.tif"), PixelFormat::kRgb48).error().code, Errc::kUnsupported);
}

TEST_F(TiffReader, AlphaIn8Bits_LeavesTheColoursThatTheFileMeans) {
  for (const Kind& kind : {Kind{4, 8}, Kind{4, 8, true, true}, Kind{2, 8}, Kind{4, 16}, Kind{2, 16, true}}) {
    for (const int alpha : {EXTRASAMPLE_ASSOCALPHA, EXTRASAMPLE_UNASSALPHA}) {
      const auto picture = read_tiff(write("a.tif", kind, static_cast<std::uint16_t>(alpha)));
      ASSERT_TRUE(picture) << picture.error().text();
      EXPECT_TRUE(picture->meaning.alpha);
      PictureBytes file = PictureBytes::open(path("a.tif")).value();
      const auto opacity = decode_tiff_opacity(file);
      ASSERT_TRUE(opacity) << opacity.error().text();
      for (int k = 0; k < kWidth * kHeight; ++k) {
        const int alpha_stored = sample(k % kWidth, k / kWidth, kind.channels - 1);
        ASSERT_NEAR(opacity->bytes[static_cast<std::size_t>(k)], alpha_stored / 257.0, 1.01) << k;
      }
      const int channels = kind.channels - 1, most = kind.bits == 8 ? 255 : 65535;
      std::size_t at = 0;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const auto stored = [&](int c) { return kind.bits == 8 ? sample(x, y, c) >> 8 : sample(x, y, c); };
          for (int c = 0; c < channels; ++c, ++at) {
            const bool multiplied = alpha == EXTRASAMPLE_ASSOCALPHA && stored(channels) > 0;
            const double meant = multiplied ? 1.0 * most * stored(c) / stored(channels) : stored(c);
            ASSERT_NEAR(picture->bytes[at], 255 * std::min(1.0, meant / most), 0.51) << x << " " << y << " " << alpha;
          }
        }
      }
    }
  }
}

TEST_F(TiffReader, Of16BitsCutAnywhere_IsOneErrorThatNamesThePicture) {
  for (const Kind& kind : {Kind{3, 16, false, false, COMPRESSION_LZW}, Kind{4, 16, true, true}}) {
    const auto whole = test::read_bytes(write("whole.tif", kind));
    for (std::size_t length = 0; length + 1 < whole.size(); length += 1 + length / 20) {
      test::write_bytes(path("cut.tif"), {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)});
      const auto picture = read_tiff(path("cut.tif"), PixelFormat::kRgb48);
      ASSERT_FALSE(picture) << "cut at " << length << " of " << whole.size();
      EXPECT_NE(picture.error().message.find("cut.tif'"), std::string::npos) << picture.error().text();
    }
  }
}

TEST_F(TiffReader, CutAnywhere_IsOneErrorThatNamesThePicture) {
  const auto whole = test::read_bytes(write("whole.tif", {3, 16, false, false, COMPRESSION_LZW}));
  for (std::size_t length = 0; length + 1 < whole.size(); length += 1 + length / 20) {
    test::write_bytes(path("cut.tif"), {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)});
    const auto picture = read_tiff(path("cut.tif"));
    ASSERT_FALSE(picture) << "cut at " << length << " of " << whole.size();
    EXPECT_NE(picture.error().message.find("cut.tif'"), std::string::npos) << picture.error().text();
  }
}

TEST_F(TiffReader, BytesChanged_NeverMoreThanAnError) {
  const auto whole = test::read_bytes(write("whole.tif", {3, 8, true, false, COMPRESSION_ADOBE_DEFLATE}));
  std::uint64_t draw = 7;
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    auto bytes = whole;
    for (int k = 0; k < 3; ++k) {
      draw = draw * 6364136223846793005ULL + 1442695040888963407ULL;
      // Half of the changes are in the directory at the end of the file, which holds sizes and offsets.
      const std::size_t from = k == 0 ? 0 : bytes.size() - std::min<std::size_t>(bytes.size(), 300);
      bytes[from + (draw >> 33) % (bytes.size() - from)] ^= static_cast<std::uint8_t>(1U << ((draw >> 20) % 8));
    }
    test::write_bytes(path("changed.tif"), bytes);
    const auto picture = read_tiff(path("changed.tif"));
    refused += picture ? 0 : 1;
    if (!picture) continue;
    EXPECT_EQ(picture->bytes.size(), packed_size(picture->format, picture->width, picture->height));
  }
  EXPECT_GT(refused, 100);
}

/// A TIFF by the specification's bytes: RGB in one strip, of `side` x `side` pixels, in a file with `data` bytes of it.
std::vector<std::uint8_t> square_tiff(std::uint32_t side, std::size_t data) {
  const auto entry = [](std::uint16_t tag, std::uint16_t type, std::uint32_t value) {
    std::vector<std::uint8_t> bytes;
    for (const std::uint32_t word : {std::uint32_t{tag} | std::uint32_t{type} << 16, std::uint32_t{1}, value}) {
      for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<std::uint8_t>(word >> (8 * k)));
    }
    return bytes;
  };
  std::vector<std::uint8_t> bytes{'I', 'I', 42, 0, 8, 0, 0, 0, 8, 0};
  for (const auto& one :
       {entry(256, 4, side), entry(257, 4, side), entry(258, 3, 8), entry(259, 3, 1), entry(262, 3, 2),
        entry(273, 4, 110), entry(277, 3, 3), entry(279, 4, static_cast<std::uint32_t>(data))}) {
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  bytes.resize(110 + data);  // the offset of the next directory, 0, and the strip
  return bytes;
}

TEST_F(TiffReader, SizesThatTheFileCannotHold_AreRefusedBeforeMemoryIsTaken) {
  test::write_bytes(path("huge.tif"), square_tiff(20'000, 100));
  const auto picture = read_tiff(path("huge.tif"));
  ASSERT_FALSE(picture);
  EXPECT_EQ(picture.error().code, Errc::kTruncated) << picture.error().text();
}

TEST_F(TiffReader, MorePixelsThanAPictureMayHave_AreRefused) {
  // 32768 x 32768 is within the limit of a side, and deflate could expand two megabytes so far.
  test::write_bytes(path("huge.tif"), square_tiff(32'768, 2'000'000));
  for (const bool whole : {true, false}) {
    const Errc code =
        whole ? read_tiff(path("huge.tif")).error().code : read_tiff_header(path("huge.tif")).error().code;
    EXPECT_EQ(code, Errc::kTooLarge);
  }
  EXPECT_NE(read_tiff(path("huge.tif")).error().message.find("huge.tif': is 32768x32768, over the limit of 512 * 2^20"),
            std::string::npos);
}

/// Bytes that this process has read by system calls.
std::uint64_t bytes_read() {
  std::ifstream io("/proc/self/io");
  std::string word;
  std::uint64_t bytes = 0;
  while (io >> word && word != "rchar:") {}
  io >> bytes;
  return bytes;
}

TEST_F(TiffReader, ForItsHeader_OnlyTheDirectoryIsRead) {
  test::write_bytes(path("large.tif"), square_tiff(2'000, 12'000'000));
  const std::uint64_t before = bytes_read();
  const auto header = read_tiff_header(path("large.tif"));
  EXPECT_LT(bytes_read() - before, 20'000U);
  ASSERT_TRUE(header) << header.error().text();
  EXPECT_EQ(header->width, 2'000);
  EXPECT_EQ(header->height, 2'000);
}

TEST_F(TiffReader, WhatIsNoPicture_IsRefusedWithItsReason) {
  EXPECT_FALSE(is_tiff(path("nowhere.tif")));
  EXPECT_EQ(read_tiff(path("nowhere.tif")).error().code, Errc::kNotFound);
  test::write_bytes(path("text.tif"), {'t', 'e', 'x', 't', 's'});
  EXPECT_FALSE(is_tiff(path("text.tif")));
  EXPECT_EQ(read_tiff(path("text.tif")).error().code, Errc::kBadFormat);
  EXPECT_EQ(read_tiff_header(path("text.tif")).error().code, Errc::kBadFormat);
  EXPECT_FALSE(is_tiff(folder_.path().string()));
}

/// The meaning of an RGB picture of a pixel whose TransferFunction is table(sample of 0 to 1), light of 0 to 1.
template <class Table>
SampleMeaning with_curve(const std::string& file, int bits, const Table& table,
                         const std::vector<float>& primaries = {}) {
  TIFF* tiff = TIFFOpen(file.c_str(), "w");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 1);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 1);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 3);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
  std::vector<std::uint16_t> light;
  const int last = (1 << bits) - 1;
  for (int k = 0; k <= last; ++k) {
    light.push_back(static_cast<std::uint16_t>(std::lround(65535 * table(static_cast<double>(k) / last))));
  }
  TIFFSetField(tiff, TIFFTAG_TRANSFERFUNCTION, light.data(), light.data(), light.data());
  if (!primaries.empty()) TIFFSetField(tiff, TIFFTAG_PRIMARYCHROMATICITIES, primaries.data());
  std::array<std::uint16_t, 3> pixel{};
  TIFFWriteScanline(tiff, pixel.data(), 0, 0);
  TIFFClose(tiff);
  return read_tiff(file).value().meaning;
}

TEST_F(TiffReader, TransferFunctionAndPrimaries_SayWhatNumbersStandFor) {
  using Curve = SampleMeaning::Curve;
  const auto srgb = [](double s) { return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4); };
  const std::string file = path("c.tif");
  for (const int bits : {8, 16}) {
    EXPECT_EQ(with_curve(file, bits, srgb).curve, Curve::kSrgb) << bits;
    EXPECT_TRUE(with_curve(file, bits, [](double s) { return s; }).is_linear()) << bits;
    for (const double gamma : {1.8, 2.2}) {
      const SampleMeaning meaning = with_curve(file, bits, [gamma](double s) { return std::pow(s, gamma); });
      EXPECT_EQ(meaning.curve, Curve::kGamma) << bits;
      EXPECT_NEAR(meaning.gamma, gamma, 0.002) << bits;
      EXPECT_TRUE(meaning.unread.empty());
    }
    EXPECT_EQ(with_curve(file, bits, [](double s) { return 1 - s; }).unread, "its TransferFunction");
    EXPECT_EQ(with_curve(file, bits, [](double s) { return s * s * (3 - 2 * s); }).unread, "its TransferFunction");
  }
  const std::vector<float> p3{0.680F, 0.320F, 0.265F, 0.690F, 0.150F, 0.060F};
  const SampleMeaning wide = with_curve(file, 8, srgb, p3);
  ASSERT_TRUE(wide.primaries);
  EXPECT_NEAR((*wide.primaries)[0], 0.3127, 1e-6) << "D65 where the file does not say white";
  EXPECT_NEAR((*wide.primaries)[2], 0.680, 1e-6);
  EXPECT_FALSE(with_curve(file, 8, srgb, {0.64F, 0.33F, 0.30F, 0.60F, 0.15F, 0.06F}).primaries);
}

}  // namespace
}  // namespace nodal::media
