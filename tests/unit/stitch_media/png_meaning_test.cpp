#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <string>

#include "stitch/media/image_file.h"
#include "stitch/media/png_meaning.h"
#include "stitch/media/png_writer.h"
#include "tests/support/pictures.h"

namespace nodal::media {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// A grey PNG of a pixel with chunks behind its header.
Bytes png_with(const std::vector<std::pair<std::string, Bytes>>& chunks) {
  Bytes png = test::png_of({128}, 1, 1, 1);
  Bytes more;
  for (const auto& [name, data] : chunks) {
    const std::size_t begin = more.size();
    const auto put = [&](std::size_t value) {
      for (int k = 3; k >= 0; --k) more.push_back(static_cast<std::uint8_t>(value >> 8 * k));
    };
    put(data.size());
    more.insert(more.end(), name.begin(), name.end());
    more.insert(more.end(), data.begin(), data.end());
    put(crc32(0, more.data() + begin + 4, static_cast<uInt>(more.size() - begin - 4)));
  }
  png.insert(png.begin() + 33, more.begin(), more.end());
  return png;
}

Bytes profile_chunk(const Bytes& profile) {
  Bytes packed(compressBound(profile.size()));
  uLongf length = packed.size();
  compress(packed.data(), &length, profile.data(), profile.size());
  Bytes data(3 + length);
  data[0] = 'p';
  std::copy_n(packed.begin(), length, data.begin() + 3);
  return data;
}

Bytes gamma_chunk(std::uint32_t gamma) {
  return {static_cast<std::uint8_t>(gamma >> 24), static_cast<std::uint8_t>(gamma >> 16),
          static_cast<std::uint8_t>(gamma >> 8), static_cast<std::uint8_t>(gamma)};
}

SampleMeaning meaning_of(const std::vector<std::pair<std::string, Bytes>>& chunks) {
  return decode_image(png_with(chunks), "a.png").value().meaning;
}

TEST(PngMeaning, ChunksOfColour_SayWhatNumbersStandFor) {
  EXPECT_EQ(meaning_of({}).curve, SampleMeaning::Curve::kUnsaid);
  EXPECT_EQ(meaning_of({{"sRGB", {0}}}).curve, SampleMeaning::Curve::kSrgb);
  EXPECT_EQ(meaning_of({{"gAMA", gamma_chunk(45455)}}).curve, SampleMeaning::Curve::kSrgb);
  EXPECT_TRUE(meaning_of({{"gAMA", gamma_chunk(100000)}}).is_linear());
  EXPECT_NEAR(meaning_of({{"gAMA", gamma_chunk(55556)}}).gamma, 1.8, 1e-4);
  EXPECT_FALSE(meaning_of({{"gAMA", gamma_chunk(100000)}, {"sRGB", {0}}}).is_linear()) << "sRGB counts first";
}

TEST(PngMeaning, CodePoints_CountBeforeEverythingElse) {
  const auto coded = [](std::uint8_t primaries, std::uint8_t transfer, std::uint8_t matrix = 0, std::uint8_t full = 1) {
    return meaning_of({{"gAMA", gamma_chunk(55556)},
                       {"iCCP", profile_chunk(Bytes(300, 7))},
                       {"cICP", {primaries, transfer, matrix, full}}});
  };
  const SampleMeaning p3 = coded(12, 13);
  EXPECT_TRUE(p3.icc.empty());
  EXPECT_EQ(p3.curve, SampleMeaning::Curve::kSrgb);
  EXPECT_EQ(p3.primaries, (std::array{0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060}));  // Display P3
  EXPECT_EQ(coded(1, 13).primaries, std::nullopt);
  EXPECT_TRUE(coded(1, 8).is_linear());
  EXPECT_EQ(coded(1, 4).gamma, 2.2);
  EXPECT_EQ(coded(1, 1).curve, SampleMeaning::Curve::kUnsaid) << "a picture of a film, by FFmpeg";
  EXPECT_EQ(coded(9, 16).unread, "PQ (HDR)");
  EXPECT_EQ(coded(9, 18).unread, "HLG (HDR)");
  EXPECT_EQ(coded(99, 13).unread, "the colour primaries 99 of H.273");
  EXPECT_EQ(coded(1, 99).unread, "the transfer characteristics 99 of H.273");
  EXPECT_EQ(coded(1, 13, 1).unread, "the matrix 1 of H.273");
  EXPECT_EQ(coded(1, 13, 0, 0).unread, "video's narrow range");
  EXPECT_TRUE(meaning_of({{"cICP", {1, 8, 0}}}).unread.empty()) << "a chunk of another length is none";
}

TEST(PngMeaning, AProfile_IsKeptWhateverLibpngThinksOfIt) {
  // libpng drops a profile for colours of a grey picture, and one that is broken, with a warning only.
  const Bytes profile(300, 7);
  EXPECT_EQ(meaning_of({{"iCCP", profile_chunk(profile)}}).icc, profile);
  EXPECT_EQ(meaning_of({{"iCCP", {'p', 0, 0, 1, 2, 3}}}).icc, Bytes{0}) << "not taken for no profile";
}

TEST(PngMeaning, ChunksOverTheirLimits_AreLeftOutOrRefused) {
  const Bytes zeros(kMaxPngChunkBytes + 1);
  EXPECT_EQ(meaning_of({{"iCCP", profile_chunk(zeros)}}).icc, Bytes{0});
  std::vector<std::pair<std::string, Bytes>> texts;
  for (std::uint32_t k = 0; k < 4 * kMaxPngTexts; ++k) texts.push_back({"tEXt", {'k', 0, 'v'}});
  const std::string xmp = "XML:com.adobe.xmp";
  Bytes packet(xmp.begin(), xmp.end());
  packet.insert(packet.end(), {0, 0, 0, 0, 0, 'x'});
  EXPECT_EQ(decode_image(png_with({{"iTXt", packet}}), "a.png").value().metadata.xmp, "x");
  texts.push_back({"iTXt", packet});
  const auto many = decode_image(png_with(texts), "a.png");
  ASSERT_TRUE(many) << many.error().text();
  EXPECT_EQ(many->metadata.xmp, "");
}

TEST(PngMeaning, WhatIsWritten_IsRead) {
  PngNotes notes;
  notes.meaning = SampleMeaning::linear();
  notes.exif = {'I', 'I', 42, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  notes.xmp = "<x/>";
  notes.comment = "Numbers are proportional to light. full_exposure_ns=1234: at 0 dB";
  const Bytes samples{1, 2};
  const DecodedImage image = decode_image(png_file({1, 1, 1, 16, samples}, notes).value(), "a.png").value();
  EXPECT_TRUE(image.meaning.is_linear());
  EXPECT_EQ(image.meaning.full_exposure_ns, 1234U);
  EXPECT_EQ(image.metadata.exif, notes.exif);
  EXPECT_EQ(image.metadata.xmp, notes.xmp);
}

}  // namespace
}  // namespace nodal::media
