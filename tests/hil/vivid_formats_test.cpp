// Every format that vivid shares with heads (it has no Bayer and no JPEG) shows vivid's colour bars: the colours are
// those of its RGB24 pictures.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "stitch/decode/frame_decoder.h"
#include "vivid.h"

namespace nodal::hil {
namespace {

using hal::FrameView;
using Colour = std::array<double, 3>;
constexpr int kBars = 8;
using Bars = std::array<Colour, kBars>;

/// The mean of a component over a square of the picture, given in picture pixels.
double mean_of(const ImageView& picture, std::size_t c, int x0, int y0, int side) {
  const PlaneView& plane = picture.planes[c];
  const PlaneGrid grid = component_grid(picture.format, static_cast<int>(c));
  double sum = 0;
  int count = 0;
  for (int y = y0 / grid.step_y; y < (y0 + side) / grid.step_y; ++y) {
    for (int x = x0 / grid.step_x; x < (x0 + side) / grid.step_x; ++x, ++count) {
      sum += plane.data[y * plane.row_stride + x * plane.pixel_stride];
    }
  }
  return sum / count;
}

/// R G B in the middle of every bar, below the text.
Bars bars_of(const ImageView& picture) {
  Bars bars;
  constexpr int kSide = 12;
  for (int bar = 0; bar < kBars; ++bar) {
    const int x = (2 * bar + 1) * picture.width / (2 * kBars) / 2 * 2 - kSide / 2;
    const int y = picture.height - kSide - 2;
    Colour c{};
    for (std::size_t i = 0; i < 3; ++i) c[i] = mean_of(picture, i, x, y, kSide);
    if (has_chroma(picture.format)) {
      c = {c[0] + 1.402 * (c[2] - 128), c[0] - 0.344136 * (c[1] - 128) - 0.714136 * (c[2] - 128),
           c[0] + 1.772 * (c[1] - 128)};
    }
    bars[static_cast<std::size_t>(bar)] = c;
  }
  return bars;
}

Bars filmed(PixelFormat format) {
  hal::linux_os::LinuxClock clock;
  hal::v4l2::V4l2Enumerator enumerator(clock);
  enumerator.request(vivid_path(0), webcam(format));
  auto head = enumerator.open_and_wait(vivid_path(0));
  if (!head) throw std::runtime_error(head.error().text());
  if (!(*head)->start(hal::TriggerMode::kFreeRun)) throw std::runtime_error("does not start");
  for (int i = 0; i < 2000; ++i) {
    const auto frame = (*head)->take_frame();
    if (!frame) throw std::runtime_error(frame.error().text());
    if (*frame) {
      const ImageView& image = (*frame)->image;
      decode::FrameDecoder decoder(format, format, image.width, image.height);
      if (!decoder.needed(image)) return bars_of(image);
      ImageView picture;
      EXPECT_EQ(decoder.decode(image, picture), decode::DecodeFault::kNone);
      return bars_of(picture);
    }
    wait_for(Duration::milliseconds(1));
  }
  throw std::runtime_error("no frame");
}

TEST(VividFormats, TheColoursOfTheBars_AreTheSameInEveryFormat) {
  const Bars expected = filmed(PixelFormat::kRgb24);
  const Colour yellow = expected[1];
  EXPECT_GT(yellow[0] + yellow[1] - 2 * yellow[2], 300);
  for (const PixelFormat format :
       {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy, PixelFormat::kI422}) {
    const Bars got = filmed(format);
    for (std::size_t bar = 0; bar < kBars; ++bar) {
      for (std::size_t c = 0; c < 3; ++c) {
        // Y U V of 8 bits is a level or two from R G B.
        EXPECT_NEAR(got[bar][c], expected[bar][c], 3) << pixel_format_name(format) << " bar " << bar << " colour " << c;
      }
    }
  }
}

}  // namespace
}  // namespace nodal::hil
