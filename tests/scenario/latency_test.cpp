// The host's measurement of a head's control latency, on heads whose latency is known.
#include <gtest/gtest.h>

#include "host_tool/input/control_latency.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

class Latency : public testing::TestWithParam<int> {};

host::ControlLatency measure(Stand& stand, std::uint32_t head) {
  const auto rig =
      host::RigConnection::over(stand.listener.connect(), "stand", Duration::seconds(60),
                                [&](hal::LinkPort&, bool, Duration) { stand.run(Duration::milliseconds(1)); });
  if (!rig) throw std::runtime_error(rig.error().text());
  wire::Request request;
  request.mutable_heads();
  const auto heads = (*rig)->ask(request);
  if (!heads) throw std::runtime_error(heads.error().text());
  const auto measured = host::measure_control_latency(**rig, heads->heads().heads(static_cast<int>(head)), [](int) {});
  if (!measured) throw std::runtime_error(measured.error().text());
  return *measured;
}

TEST_P(Latency, OfAHead_IsTheHeadsOwnAndTheExposureIsRestored) {
  StandOptions options;
  options.world.head.limits.control_latency_frames = GetParam();
  Stand stand(options);
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const std::uint64_t before = host.heads().heads(3).exposure_ns();
  const host::ControlLatency latency = measure(stand, 3);
  EXPECT_EQ(latency.seen.low(), GetParam());
  EXPECT_EQ(latency.seen.high(), GetParam());
  EXPECT_EQ(latency.stated.low(), GetParam());
  EXPECT_EQ(latency.stated.high(), GetParam());
  EXPECT_EQ(latency.stepped_ns, before / 2);
  EXPECT_LT(latency.stepped_brightness, latency.brightness);
  stand.run(Duration::seconds(1));
  EXPECT_EQ(host.heads().heads(3).exposure_ns(), before);
}

INSTANTIATE_TEST_SUITE_P(Frames, Latency, testing::Values(0, 1, 2, 5));

TEST(LatencyBounds, OfContradictorySamples_ShowThatItVaries) {
  host::LatencyBounds bounds;
  bounds.has_old(1);
  bounds.has_new(2);
  EXPECT_TRUE(bounds.exact());
  EXPECT_EQ(bounds.low(), 2);
  bounds.has_old(2);
  EXPECT_FALSE(bounds.exact());
  EXPECT_EQ(bounds.low(), 3);
  EXPECT_EQ(bounds.high(), 2);
}

TEST(LatencyErrors, ADarkScene_IsSaidToBeTooDarkAndTheExposureIsRestored) {
  StandOptions options;
  Stand stand(options);
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.world.head(2).set_light(0);
  const std::uint64_t before = host.heads().heads(2).exposure_ns();
  try {
    measure(stand, 2);
    ADD_FAILURE() << "nothing can be seen in the dark";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("with more light"), std::string::npos) << error.what();
  }
  stand.run(Duration::seconds(1));
  EXPECT_EQ(host.heads().heads(2).exposure_ns(), before);
}

}  // namespace
}  // namespace nodal::scenario
