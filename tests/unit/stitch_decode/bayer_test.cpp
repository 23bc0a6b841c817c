// Demosaicing against scenes whose every colour is known.
#include "stitch/decode/bayer.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "tests/support/pictures.h"

namespace nodal::decode {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Rgb = std::array<int, 3>;

/// The colour of pixel (x, y) of a mosaic, from its name: "RGGB8".
std::size_t colour_of(PixelFormat format, int x, int y) {
  const char letter = pixel_format_name(format)[static_cast<std::size_t>(y % 2 * 2 + x % 2)];
  return letter == 'R' ? 0 : letter == 'G' ? 1 : 2;
}

template <class Scene>
Bytes mosaic_of(PixelFormat format, int width, int height, const Scene& scene) {
  Bytes bytes;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) bytes.push_back(static_cast<std::uint8_t>(scene(x, y)[colour_of(format, x, y)]));
  }
  return bytes;
}

Bytes demosaiced(PixelFormat format, int width, int height, const Bytes& mosaic, PixelFormat to) {
  Bytes out(packed_size(to, width, height));
  Bytes memory;
  demosaic(packed_image(format, width, height, mosaic.data()), packed_image(to, width, height, out.data()), memory);
  return out;
}

constexpr std::array kOrders{PixelFormat::kRggb8, PixelFormat::kGrbg8, PixelFormat::kGbrg8, PixelFormat::kBggr8};

TEST(Bayer, OneColour_ComesBackExactlyAlsoAtTheEdges) {
  for (const PixelFormat format : kOrders) {
    for (const auto& [width, height] : {std::pair{16, 12}, {5, 4}, {4, 5}}) {
      const auto scene = [](int, int) { return Rgb{200, 90, 30}; };
      const Bytes rgb = demosaiced(format, width, height, mosaic_of(format, width, height, scene), PixelFormat::kRgb24);
      for (std::size_t i = 0; i < rgb.size(); i += 3) {
        ASSERT_EQ((Rgb{rgb[i], rgb[i + 1], rgb[i + 2]}), (Rgb{200, 90, 30})) << pixel_format_name(format);
      }
    }
  }
}

/// All filters of the source are exact for colours that change linearly.
TEST(Bayer, ColoursThatChangeLinearly_AreExactInside) {
  const auto scene = [](int x, int y) { return Rgb{20 + 4 * x + 2 * y, 200 - 2 * x - 4 * y, 60 + 2 * x}; };
  for (const PixelFormat format : kOrders) {
    const Bytes rgb = demosaiced(format, 24, 20, mosaic_of(format, 24, 20, scene), PixelFormat::kRgb24);
    for (int y = 2; y < 18; ++y) {
      for (int x = 2; x < 22; ++x) {
        const std::size_t i = static_cast<std::size_t>(y * 24 + x) * 3;
        ASSERT_EQ((Rgb{rgb[i], rgb[i + 1], rgb[i + 2]}), scene(x, y)) << pixel_format_name(format) << x << "," << y;
      }
    }
  }
}

/// A detail without colour: bilinear interpolation gives it coloured edges, these filters hardly.
TEST(Bayer, GreyDetail_IsSharperThanByBilinearInterpolation) {
  const auto scene = [](int x, int y) {
    const int value = 128 + static_cast<int>(std::lround(90 * std::sin(0.9 * x) * std::cos(0.7 * y)));
    return Rgb{value, value, value};
  };
  constexpr int kSide = 64;
  const Bytes mosaic = mosaic_of(PixelFormat::kRggb8, kSide, kSide, scene);
  const Bytes rgb = demosaiced(PixelFormat::kRggb8, kSide, kSide, mosaic, PixelFormat::kRgb24);
  double squares = 0, bilinear = 0;
  for (int y = 2; y < kSide - 2; ++y) {
    for (int x = 2; x < kSide - 2; ++x) {
      const std::size_t i = static_cast<std::size_t>(y * kSide + x);
      for (std::size_t c = 0; c < 3; ++c) squares += std::pow(rgb[3 * i + c] - scene(x, y)[c], 2);
      if (colour_of(PixelFormat::kRggb8, x, y) == 1) continue;
      const double green = (mosaic[i - 1] + mosaic[i + 1] + mosaic[i - kSide] + mosaic[i + kSide]) / 4.0;
      bilinear += 3 * std::pow(green - scene(x, y)[1], 2);
    }
  }
  EXPECT_LT(squares, bilinear / 2);
}

TEST(Bayer, I420AndGrey_AreTheColoursByBt601) {
  std::mt19937 random(5);
  for (const auto& [width, height] : {std::pair{32, 24}, {33, 23}}) {
    Bytes mosaic(static_cast<std::size_t>(width * height));
    for (std::uint8_t& sample : mosaic) sample = static_cast<std::uint8_t>(random());
    const Bytes rgb = demosaiced(PixelFormat::kGbrg8, width, height, mosaic, PixelFormat::kRgb24);
    Bytes yuv = demosaiced(PixelFormat::kGbrg8, width, height, mosaic, PixelFormat::kI420);
    const Bytes grey = demosaiced(PixelFormat::kGbrg8, width, height, mosaic, PixelFormat::kGrey8);
    const MutableImageView view = packed_image(PixelFormat::kI420, width, height, yuv.data());
    const auto at = [&](int x, int y, std::size_t c) {
      const int i = std::min(y, height - 1) * width + std::min(x, width - 1);
      return double{rgb[static_cast<std::size_t>(i) * 3 + c] * 1.0};
    };
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double luma = 0.299 * at(x, y, 0) + 0.587 * at(x, y, 1) + 0.114 * at(x, y, 2);
        ASSERT_NEAR(view.planes[0].data[y * width + x], luma, 0.51);
        ASSERT_EQ(grey[static_cast<std::size_t>(y * width + x)], view.planes[0].data[y * width + x]);
      }
    }
    for (int y = 0; y < view.planes[1].height; ++y) {
      for (int x = 0; x < view.planes[1].width; ++x) {
        std::array<double, 3> mean{};
        for (std::size_t c = 0; c < 3; ++c) {
          mean[c] =
              (at(2 * x, 2 * y, c) + at(2 * x + 1, 2 * y, c) + at(2 * x, 2 * y + 1, c) + at(2 * x + 1, 2 * y + 1, c)) /
              4;
        }
        const double u = 128 - 0.168736 * mean[0] - 0.331264 * mean[1] + 0.5 * mean[2];
        const double v = 128 + 0.5 * mean[0] - 0.418688 * mean[1] - 0.081312 * mean[2];
        ASSERT_NEAR(view.planes[1].data[y * view.planes[1].row_stride + x], std::min(u, 255.0), 0.52);
        ASSERT_NEAR(view.planes[2].data[y * view.planes[2].row_stride + x], std::min(v, 255.0), 0.52);
      }
    }
  }
}

}  // namespace
}  // namespace nodal::decode
