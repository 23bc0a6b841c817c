// JPEG frames as cameras send them, made by libjpeg-turbo's encoder.
#include "stitch/decode/jpeg_frame.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/support/pictures.h"

namespace nodal::decode {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Y U V planes of 4:4:4 in which every component is a plane over the picture, so that its mean over any block is its
/// value in the block's middle.
double ramp(std::size_t c, double x, double y) {
  constexpr double kSlope[3][2] = {{0.5, 0.3}, {0.6, 0.4}, {-0.4, 0.7}};
  constexpr double kStart[3] = {60, 80, 120};
  return kStart[c] + kSlope[c][0] * x + kSlope[c][1] * y;
}

/// Where a plane of this subsampling has its samples: JFIF puts them into the middle of the pixels that they are for.
Bytes ramp_jpeg(int width, int height, int subsampling, int flags = 0) {
  std::array<Bytes, 3> planes;
  std::array<const unsigned char*, 3> data{};
  std::array<int, 3> strides{};
  const int count = subsampling == TJSAMP_GRAY ? 1 : 3;
  for (int c = 0; c < count; ++c) {
    const int w = tjPlaneWidth(c, width, subsampling);
    const int h = tjPlaneHeight(c, height, subsampling);
    const double step_x = c == 0 ? 1 : static_cast<double>(tjMCUWidth[subsampling]) / 8;
    const double step_y = c == 0 ? 1 : static_cast<double>(tjMCUHeight[subsampling]) / 8;
    auto& plane = planes[static_cast<std::size_t>(c)];
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        const double value = ramp(static_cast<std::size_t>(c), (x + 0.5) * step_x, (y + 0.5) * step_y);
        plane.push_back(static_cast<std::uint8_t>(std::lround(value)));
      }
    }
    data[static_cast<std::size_t>(c)] = plane.data();
    strides[static_cast<std::size_t>(c)] = w;
  }
  void* const encoder = tjInitCompress();
  unsigned char* out = nullptr;
  unsigned long size = 0;
  const int status = tjCompressFromYUVPlanes(encoder, data.data(), width, strides.data(), height, subsampling, &out,
                                             &size, 98, flags | TJFLAG_ACCURATEDCT);
  EXPECT_EQ(status, 0) << tjGetErrorStr2(encoder);
  Bytes jpeg(out, out + size);
  tjFree(out);
  tjDestroy(encoder);
  return jpeg;
}

struct Decoded {
  Bytes bytes;
  MutableImageView view;
  DecodeFault fault;
};
Decoded decoded(const Bytes& jpeg, int width, int height, PixelFormat as = PixelFormat::kI420) {
  Decoded result;
  result.bytes.assign(packed_size(as, width, height), 0);
  result.view = packed_image(as, width, height, result.bytes.data());
  JpegDecoder decoder;
  result.fault = decoder.decode(jpeg, result.view);
  return result;
}

class Subsamplings : public testing::TestWithParam<int> {};

TEST_P(Subsamplings, AnyChroma_BecomesThatOfI420AtItsPlace) {
  for (const auto& [width, height] : {std::pair{96, 80}, {99, 77}, {17, 5}}) {
    const Decoded picture = decoded(ramp_jpeg(width, height, GetParam()), width, height);
    ASSERT_EQ(picture.fault, DecodeFault::kNone) << decode_fault_text(picture.fault);
    for (std::size_t c = 0; c < 3; ++c) {
      const MutablePlaneView& plane = picture.view.planes[c];
      const int step = c == 0 ? 1 : 2;
      double worst = 0;
      // Inside: at the edges the encoder and the last odd column repeat samples.
      for (int y = 0; y < plane.height - 1; ++y) {
        for (int x = c == 0 ? 0 : 1; x < plane.width - 2; ++x) {
          const double expected =
              c > 0 && GetParam() == TJSAMP_GRAY ? 128 : ramp(c, (x + 0.5) * step, (y + 0.5) * step);
          worst = std::max(worst, std::abs(plane.data[y * plane.row_stride + x] - expected));
        }
      }
      // Rounding of the samples, of the JPEG at quality 98, and of their mean.
      EXPECT_LE(worst, 2.6) << width << "x" << height << " component " << c;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Jpeg, Subsamplings,
                         testing::Values(TJSAMP_444, TJSAMP_422, TJSAMP_420, TJSAMP_440, TJSAMP_411, TJSAMP_GRAY));

TEST(JpegFrame, RgbAndGrey_AreWhatTheEncoderWasGiven) {
  const Bytes rgb = test::smooth_rgb(64, 48);
  const Bytes jpeg = test::jpeg_of(rgb, 64, 48, test::Sampling::k444, 98);
  const Decoded colour = decoded(jpeg, 64, 48, PixelFormat::kRgb24);
  ASSERT_EQ(colour.fault, DecodeFault::kNone);
  EXPECT_GT(test::psnr(colour.bytes, rgb), 40);
  const Decoded grey = decoded(jpeg, 64, 48, PixelFormat::kGrey8);
  ASSERT_EQ(grey.fault, DecodeFault::kNone);
  Bytes luma;
  for (std::size_t i = 0; i < rgb.size(); i += 3) {
    luma.push_back(static_cast<std::uint8_t>(0.299 * rgb[i] + 0.587 * rgb[i + 1] + 0.114 * rgb[i + 2] + 0.5));
  }
  EXPECT_GT(test::psnr(grey.bytes, luma), 40);
}

/// The position of a marker's 0xFF; the marker must be there.
std::size_t place_of(const Bytes& jpeg, std::uint8_t marker, std::size_t from = 2) {
  for (std::size_t i = from; i + 1 < jpeg.size(); ++i) {
    if (jpeg[i] == 0xFF && jpeg[i + 1] == marker) return i;
  }
  throw std::runtime_error("no such marker");
}

TEST(JpegFrame, WithoutHuffmanTables_TheStandardOnesAreUsed) {
  const Bytes whole = ramp_jpeg(96, 80, TJSAMP_422);
  Bytes bare = whole;
  int removed = 0;
  while (std::search_n(bare.begin(), bare.end(), 1, 0xFF) != bare.end()) {
    std::size_t at = 0;
    try {
      at = place_of(bare, 0xC4);
    } catch (const std::runtime_error&) {
      break;
    }
    if (at > place_of(bare, 0xDA)) break;
    const auto length = static_cast<std::ptrdiff_t>(bare[at + 2] << 8 | bare[at + 3]);
    const auto begin = bare.begin() + static_cast<std::ptrdiff_t>(at);
    bare.erase(begin, begin + 2 + length);
    ++removed;
  }
  ASSERT_GT(removed, 0);
  EXPECT_EQ(decoded(bare, 96, 80).bytes, decoded(whole, 96, 80).bytes);
}

TEST(JpegFrame, BytesThatDoNotBelongThere_AreSkipped) {
  const Bytes whole = ramp_jpeg(96, 80, TJSAMP_420);
  Bytes before_end = whole;
  before_end.insert(before_end.end() - 2, {0x12, 0x34, 0x56, 0x78, 0x12, 0x34, 0x56, 0x78});
  const Decoded first = decoded(before_end, 96, 80);
  EXPECT_EQ(first.fault, DecodeFault::kNone);
  EXPECT_EQ(first.bytes, decoded(whole, 96, 80).bytes);
  Bytes after_end = whole;
  after_end.resize(after_end.size() + 1000);  // drivers pad
  EXPECT_EQ(decoded(after_end, 96, 80).fault, DecodeFault::kNone);
}

TEST(JpegFrame, Faults_EachHasItsName) {
  const Bytes good = ramp_jpeg(96, 80, TJSAMP_420);
  EXPECT_EQ(decoded({}, 96, 80).fault, DecodeFault::kNoJpeg);
  EXPECT_EQ(decoded(Bytes(5000, 0x55), 96, 80).fault, DecodeFault::kNoJpeg);
  EXPECT_EQ(decoded({good.begin(), good.begin() + 20}, 96, 80).fault, DecodeFault::kNoJpeg);
  EXPECT_EQ(decoded({good.begin(), good.end() - static_cast<std::ptrdiff_t>(good.size() / 4)}, 96, 80).fault,
            DecodeFault::kBroken);
  EXPECT_EQ(decoded(good, 96, 96).fault, DecodeFault::kOtherSize);
  EXPECT_EQ(decoded(good, 192, 80).fault, DecodeFault::kOtherSize);
  EXPECT_EQ(decoded(ramp_jpeg(96, 80, TJSAMP_420, TJFLAG_PROGRESSIVE), 96, 80).fault, DecodeFault::kSeveralScans);
  Bytes damaged = good;
  for (std::size_t i = good.size() / 2; i < good.size() / 2 + 200; ++i) damaged[i] = 0xAA;
  EXPECT_EQ(decoded(damaged, 96, 80).fault, DecodeFault::kBroken);
}

TEST(JpegFrame, ForPrint_IsAnotherCoding) {
  const Bytes cmyk(64 * 48 * 4, 100);
  void* const encoder = tjInitCompress();
  unsigned char* out = nullptr;
  unsigned long size = 0;
  ASSERT_EQ(tjCompress2(encoder, cmyk.data(), 64, 0, 48, TJPF_CMYK, &out, &size, TJSAMP_444, 90, 0), 0);
  const Bytes jpeg(out, out + size);
  tjFree(out);
  tjDestroy(encoder);
  EXPECT_EQ(decoded(jpeg, 64, 48).fault, DecodeFault::kOtherCoding);
}

/// A header that asks for each component in a scan of its own.
TEST(JpegFrame, ComponentsOneAfterAnother_AreRefusedBeforeTheyCostTime) {
  Bytes jpeg = ramp_jpeg(96, 80, TJSAMP_420);
  jpeg[place_of(jpeg, 0xDA) + 4] = 1;
  EXPECT_EQ(decoded(jpeg, 96, 80).fault, DecodeFault::kSeveralScans);
}

TEST(JpegFrame, CutOrChangedAnywhere_NeverCrashesAndTheDecoderGoesOn) {
  const Bytes good = ramp_jpeg(99, 77, TJSAMP_411);
  Bytes into(packed_size(PixelFormat::kI420, 99, 77));
  const MutableImageView view = packed_image(PixelFormat::kI420, 99, 77, into.data());
  JpegDecoder decoder;
  for (std::size_t length = 0; length < good.size(); ++length) {
    // The last marker is not needed to decode a picture.
    EXPECT_TRUE(decoder.decode({good.data(), length}, view) != DecodeFault::kNone || length + 8 > good.size())
        << length;
  }
  std::mt19937 random(7);
  for (int i = 0; i < 3000; ++i) {
    Bytes changed = good;
    for (int k = 0; k < 3; ++k) changed[random() % changed.size()] = static_cast<std::uint8_t>(random());
    (void)decoder.decode(changed, view);
  }
  EXPECT_EQ(decoder.decode(good, view), DecodeFault::kNone);
  EXPECT_EQ(into, decoded(good, 99, 77).bytes);
}

/// A grey JPEG of one level, with an AVI1 segment if `field` is not 0.
Bytes field_jpeg(int width, int height, std::uint8_t level, std::uint8_t field) {
  const Bytes grey(static_cast<std::size_t>(width * height), level);
  void* const encoder = tjInitCompress();
  unsigned char* out = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(tjCompress2(encoder, grey.data(), width, 0, height, TJPF_GRAY, &out, &size, TJSAMP_GRAY, 95, 0), 0);
  Bytes jpeg(out, out + size);
  tjFree(out);
  tjDestroy(encoder);
  if (field != 0) {
    const Bytes avi1{0xFF, 0xE0, 0, 10, 'A', 'V', 'I', '1', field, 0, 0, 0};
    jpeg.insert(jpeg.begin() + 2, avi1.begin(), avi1.end());
  }
  return jpeg;
}

Bytes joined(Bytes first, const Bytes& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

void expect_rows(const Decoded& frame, int even, int odd) {
  ASSERT_EQ(frame.fault, DecodeFault::kNone) << decode_fault_text(frame.fault);
  const MutablePlaneView& luma = frame.view.planes[0];
  for (int y = 0; y < luma.height; ++y) {
    for (int x = 0; x < luma.width; ++x) {
      ASSERT_NEAR(luma.data[y * luma.row_stride + x], y % 2 == 0 ? even : odd, 2) << x << "," << y;
    }
  }
}

TEST(TwoJpegs, AreTheFieldsOfAFrame_TheTopOneFirstUnlessTheySayOtherwise) {
  const auto two = [](std::uint8_t first, std::uint8_t second) {
    return joined(field_jpeg(50, 24, 60, first), field_jpeg(50, 24, 180, second));
  };
  for (const PixelFormat as : {PixelFormat::kI420, PixelFormat::kGrey8}) {
    expect_rows(decoded(two(0, 0), 50, 48, as), 60, 180);
    expect_rows(decoded(two(1, 2), 50, 48, as), 60, 180);
    expect_rows(decoded(two(2, 1), 50, 48, as), 180, 60);
  }
  // Bytes between the two, as some cameras pad each field.
  Bytes padded = field_jpeg(50, 24, 60, 1);
  padded.resize(padded.size() + 13);
  expect_rows(decoded(joined(padded, field_jpeg(50, 24, 180, 2)), 50, 48), 60, 180);
}

TEST(TwoJpegs, AFieldThatIsMissingOrWrong_IsAFault) {
  const Bytes field = field_jpeg(50, 24, 60, 1);
  EXPECT_EQ(decoded(field, 50, 48).fault, DecodeFault::kOtherSize);
  EXPECT_EQ(decoded(joined(field, field_jpeg(50, 12, 60, 2)), 50, 48).fault, DecodeFault::kOtherSize);
  EXPECT_EQ(decoded(joined(field, field_jpeg(50, 48, 60, 2)), 50, 48).fault, DecodeFault::kOtherSize);
  // Rows of chroma of a height that is not a multiple of four do not belong to one field each.
  EXPECT_EQ(decoded(joined(field_jpeg(50, 23, 60, 1), field_jpeg(50, 23, 60, 2)), 50, 46).fault,
            DecodeFault::kOtherSize);
  const Bytes both = joined(field, field);
  for (std::size_t bytes = 0; bytes < both.size(); ++bytes) {
    EXPECT_NE(decoded(Bytes(both.begin(), both.begin() + static_cast<std::ptrdiff_t>(bytes)), 50, 48).fault,
              DecodeFault::kNone)
        << bytes;
  }
}

}  // namespace
}  // namespace nodal::decode
