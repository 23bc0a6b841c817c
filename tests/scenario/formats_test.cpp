// Rigs whose heads deliver what the blend cannot read as it is: their raymaps beside those of the same rig with heads
// that deliver I420.
#include <gtest/gtest.h>

#include "tests/scenario/stand.h"
#include "tests/support/pictures.h"

namespace nodal::scenario {
namespace {

StandOptions with(PixelFormat pixels) {
  StandOptions options;
  options.config.raymap.format = PixelFormat::kI420;
  for (firmware::HeadConfig& head : options.config.heads) head.format = pixels;
  options.world.head.pixels = pixels;
  return options;
}

Pulled one_raymap(Stand& stand, TestHost& host) {
  const StreamId stream = host.pull(false, 1, true);
  EXPECT_TRUE(stand.run_until([&] { return host.closed.count(stream) != 0; }));
  return host.pulled[stream].at(0);
}

class Formats : public testing::TestWithParam<std::pair<PixelFormat, double>> {};

TEST_P(Formats, ARaymap_IsThatOfHeadsWithI420) {
  const auto [format, least_psnr] = GetParam();
  Stand reference(with(PixelFormat::kI420));
  Stand stand(with(format));
  TestHost& reference_host = reference.bring_up();
  TestHost& host = stand.bring_up();
  const Pulled expected = one_raymap(reference, reference_host);
  const Pulled got = one_raymap(stand, host);
  EXPECT_EQ(got.header.heads_mask(), (1U << kHeads) - 1);
  ASSERT_EQ(got.body.size(), expected.body.size());
  EXPECT_GT(test::psnr(got.body, expected.body), least_psnr);
}
// I422 and YUV411 differ in the places of chroma samples; JPEG of quality 90 and a mosaic lose detail.
INSTANTIATE_TEST_SUITE_P(Decoded, Formats,
                         testing::Values(std::pair{PixelFormat::kI422, 45.0}, std::pair{PixelFormat::kMjpeg, 38.0},
                                         std::pair{PixelFormat::kRggb8, 32.0}, std::pair{PixelFormat::kGrbg8, 32.0},
                                         std::pair{PixelFormat::kGbrg8, 32.0}, std::pair{PixelFormat::kBggr8, 32.0},
                                         std::pair{PixelFormat::kYuv411, 38.0}),
                         [](const auto& one) { return std::string(pixel_format_name(one.param.first)); });

TEST(DamagedJpegs, AHeadWithOne_IsMissingInThatRaymapAndItsHeadSaysSo) {
  Stand stand(with(PixelFormat::kMjpeg));
  TestHost& host = stand.bring_up();
  (void)one_raymap(stand, host);
  stand.world.head(3).spoil_next_frame();
  const StreamId stream = host.pull(false, 30, true);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.count(stream) != 0; }));
  int without = 0;
  for (const Pulled& raymap : host.pulled[stream]) without += (raymap.header.heads_mask() & 8U) == 0 ? 1 : 0;
  EXPECT_EQ(without, 1);
  const wire::Heads heads = host.heads();
  EXPECT_EQ(heads.heads(3).undecodable(), 1u);
  EXPECT_EQ(heads.heads(2).undecodable(), 0u);
  EXPECT_EQ(heads.heads(3).problem(), "") << "it has recovered";
}

}  // namespace
}  // namespace nodal::scenario
