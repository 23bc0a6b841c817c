#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <cmath>

#include "hal/sim/scene/response.h"
#include "protocol/base/angles.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

/// Decodes a JPEG to RGB24; empty if it is not a JPEG.
std::vector<std::uint8_t> decode(const std::vector<std::uint8_t>& jpeg, int& width, int& height) {
  const tjhandle handle = tjInitDecompress();
  int subsampling = 0;
  int colours = 0;
  std::vector<std::uint8_t> rgb;
  if (tjDecompressHeader3(handle, jpeg.data(), jpeg.size(), &width, &height, &subsampling, &colours) == 0) {
    rgb.resize(static_cast<std::size_t>(width * height * 3));
    if (tjDecompress2(handle, jpeg.data(), jpeg.size(), rgb.data(), width, 0, height, TJPF_RGB, 0) != 0) rgb.clear();
  }
  tjDestroy(handle);
  return rgb;
}

bool contains(const std::vector<std::uint8_t>& bytes, const std::string& text) {
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()).find(text) != std::string::npos;
}

TEST(BringUp, AFreshRig_SaysWhatItNeeds) {
  Stand stand;
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(300));
  const wire::RigStatus status = host.status();
  EXPECT_EQ(status.state(), "no-calibration");
  EXPECT_NE(status.problem().find("nodal calibration upload"), std::string::npos) << status.problem();
  EXPECT_EQ(status.raymaps(), 0u);
  EXPECT_GT(status.sets(), 5u);
  EXPECT_EQ(host.pull(true, 1), 0u);
  EXPECT_EQ(host.refusal.code(), static_cast<unsigned>(Errc::kNotReady));
}

TEST(BringUp, StatusRightAfterAnUpload_DoesNotMissTheCalibration) {
  for (int phase = 0; phase < 12; ++phase) {
    Stand stand;
    TestHost& host = stand.connect();
    stand.run(Duration::milliseconds(300 + 5 * phase));
    const wire::Reply done = host.upload(to_json(stand.options.truth));
    ASSERT_FALSE(done.has_error()) << done.error().message();
    const wire::RigStatus status = host.status();
    EXPECT_NE(status.state(), "no-calibration") << status.problem();
  }
}

TEST(BringUp, UploadThenPull_GivesSpheresThatNameTheirCalibration) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const StreamId stream = host.pull(true, 3);
  ASSERT_NE(stream, 0u);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  ASSERT_EQ(host.pulled[stream].size(), 3u);
  const Sha256 id = calibration_id(stand.options.truth);
  for (const Pulled& raymap : host.pulled[stream]) {
    EXPECT_EQ(raymap.header.coding(), "jpeg");
    EXPECT_EQ(raymap.header.heads_mask(), (1u << kHeads) - 1);
    EXPECT_EQ(raymap.header.calibration_id(), sha256_to_wire(id));
    EXPECT_TRUE(contains(raymap.body, "GPano:ProjectionType=\"equirectangular\""));
    EXPECT_TRUE(contains(raymap.body, "calibration=" + to_hex(id)));
    int width = 0;
    int height = 0;
    EXPECT_FALSE(decode(raymap.body, width, height).empty());
    EXPECT_EQ(width, 128);
    EXPECT_EQ(height, 64);
  }
  stand.run(Duration::seconds(1));
  const wire::RigStatus status = host.status();
  EXPECT_EQ(status.state(), "running") << status.problem();
  EXPECT_EQ(status.calibration_name(), "small");
  EXPECT_EQ(status.frames_taken(), status.frames_in_sets() + status.frames_held());
}

TEST(BringUp, HeadsInFreeRun_FallIntoStepWithTheGridAndLoseNothingMore) {
  Stand stand;
  stand.run(Duration::seconds(1));
  const auto before = stand.capture();
  stand.run(Duration::seconds(2));
  const auto& after = stand.capture();
  EXPECT_EQ(after.full_sets - before.full_sets, after.sets - before.sets);
  EXPECT_NEAR(static_cast<double>(after.sets - before.sets), 60, 1);
  EXPECT_EQ(after.frames.lost(), before.frames.lost());
}

TEST(BringUp, AConstantScene_IsThatConstantInEveryPixel) {
  StandOptions options;
  options.world.scene = hal::sim::constant_scene({0.25F, 0.5F, 0.75F});
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  const StreamId stream = host.pull(false, 1);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  const std::vector<std::uint8_t>& rgb = host.pulled[stream].at(0).body;
  ASSERT_EQ(rgb.size(), 128u * 64u * 3u);
  // A linear response: light 1/4, 1/2 and 3/4 of full, with the head's reference exposure.
  for (std::size_t i = 0; i < rgb.size(); i += 3) {
    ASSERT_EQ(rgb[i], 64) << "pixel " << i / 3;
    ASSERT_EQ(rgb[i + 1], 128) << "pixel " << i / 3;
    ASSERT_EQ(rgb[i + 2], 191) << "pixel " << i / 3;
  }
}

/// Light that encodes its direction: red grows to the right, green downwards, blue forward.
class CompassScene final : public hal::sim::Scene {
 public:
  hal::sim::Light light(const hal::sim::Direction& from, double) const override {
    const double norm = std::sqrt(from.x * from.x + from.y * from.y + from.z * from.z);
    const auto level = [norm](double v) { return static_cast<float>(0.5 + 0.4 * v / norm); };
    return {level(from.x), level(from.y), level(from.z)};
  }
};

TEST(BringUp, EveryPixel_HoldsTheLightOfItsRay) {
  StandOptions options;
  options.world.scene = std::make_shared<CompassScene>();
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  const StreamId stream = host.pull(false, 1);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  const std::vector<std::uint8_t>& rgb = host.pulled[stream].at(0).body;
  ASSERT_EQ(rgb.size(), 128u * 64u * 3u);
  for (int j = 0; j < 64; ++j) {
    for (int i = 0; i < 128; ++i) {
      const double theta = 2 * kPi * ((i + 0.5) / 128 - 0.5);  // atan2(X, Z)
      const double phi = kPi * ((j + 0.5) / 64 - 0.5);         // grows downwards
      const double expected[3] = {0.5 + 0.4 * std::sin(theta) * std::cos(phi), 0.5 + 0.4 * std::sin(phi),
                                  0.5 + 0.4 * std::cos(theta) * std::cos(phi)};
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t at = (static_cast<std::size_t>(j) * 128 + static_cast<std::size_t>(i)) * 3 + c;
        ASSERT_NEAR(rgb[at], expected[c] * 255, 1.5) << "pixel " << i << ", " << j << " component " << c;
      }
    }
  }
}

TEST(BringUp, ARigStartedAgain_RunsItsLastCalibrationWithoutAHost) {
  std::unique_ptr<hal::sim::SimDisk> kept;
  {
    Stand stand;
    stand.bring_up();
    kept = stand.disk->after_power_loss(7);
  }
  Stand again({}, std::move(kept));
  again.run(Duration::seconds(2));
  EXPECT_EQ(again.state(), "running");
  EXPECT_EQ(again.rig->keeper().report().in_force, calibration_id(small_calibration()));
  EXPECT_GT(again.rig->blender().counts().blended.load(), 30u);
}

TEST(BringUp, TheWatchdog_IsFedWhileEverythingMoves) {
  Stand stand;
  stand.bring_up();
  stand.run(Duration::seconds(3));
  EXPECT_TRUE(stand.watchdog.is_ready());
  EXPECT_FALSE(stand.watchdog.would_bite(Duration::seconds(1)));
  ASSERT_FALSE(stand.watchdog.lines().empty());
  EXPECT_EQ(stand.watchdog.lines().back(), "running");
}

}  // namespace
}  // namespace nodal::scenario
